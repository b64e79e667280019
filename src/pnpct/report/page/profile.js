// HU of all methods along the line that the reader has drawn.

const PLOT = { left: 60, right: 866, top: 12, bottom: 288 };

function svg(name, attributes, text = "") {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.textContent = text;
  return element;
}

// Between pixels by the four around: two samples for each pixel of the line.
function sampled(pixels) {
  const [[fromX, fromY], [toX, toY]] = state.line;
  const steps = Math.max(1, 2 * Math.ceil(Math.hypot(toX - fromX, toY - fromY)));
  return Array.from({ length: steps + 1 }, (_, i) => {
    const [x, y] = [fromX + ((toX - fromX) * i) / steps, fromY + ((toY - fromY) * i) / steps];
    const [col, row] = [Math.floor(x), Math.floor(y)];
    const { cols, rows } = scene.case;
    const value = (c, r) => pixels[Math.min(r, rows - 1) * cols + Math.min(c, cols - 1)];
    const [right, down] = [x - col, y - row];
    return (1 - down) * ((1 - right) * value(col, row) + right * value(col + 1, row))
      + down * ((1 - right) * value(col, row + 1) + right * value(col + 1, row + 1));
  });
}

function roundTicks(low, high) {
  const rough = (high - low) / 5;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= rough);
  const ticks = [];
  for (let i = Math.ceil(low / step); i * step <= high + 1e-9 * step; i++) ticks.push(i * step);
  return ticks;
}

function drawProfile() {
  const [[fromX, fromY], [toX, toY]] = state.line;
  const length = Math.hypot(toX - fromX, toY - fromY) * scene.case.spacing;
  const profiles = scene.case.order.map((name) => [name, sampled(scene.images[name])]);
  const all = profiles.flatMap(([, values]) => values);
  const [least, most] = [Math.min(...all), Math.max(...all)];
  const [low, high] = [least - 0.05 * (most - least) - 1, most + 0.05 * (most - least) + 1];
  const x = (mm) => PLOT.left + ((PLOT.right - PLOT.left) * mm) / (length || 1);
  const y = (hu) => PLOT.bottom - ((PLOT.bottom - PLOT.top) * (hu - low)) / (high - low);
  byId("profile").replaceChildren(axes(x, y, length, low, high), ...profiles.map(([name, values]) => {
    const points = values.map((hu, i) => `${x((length * i) / (values.length - 1 || 1)).toFixed(1)},${y(hu).toFixed(1)}`);
    const group = svg("g", { class: styleOf[name], "data-method": name });
    group.append(svg("polyline", { class: "stroke", points: points.join(" ") }));
    return group;
  }));
  byId("profile-says").textContent =
    `${scene.case.label}: ${length.toFixed(1)} mm from column ${fromX}, row ${fromY} to column ${toX}, row ${toY}.`;
  showEnds();
}

function axes(x, y, length, low, high) {
  const group = svg("g", { class: "axis" });
  for (const mm of length ? roundTicks(0, length) : []) {
    group.append(svg("line", { x1: x(mm), x2: x(mm), y1: PLOT.top, y2: PLOT.bottom }));
    group.append(svg("text", { x: x(mm), y: PLOT.bottom + 17, "text-anchor": "middle" }, signedText(Number(mm.toPrecision(6)), mm % 1 ? 1 : 0)));
  }
  for (const hu of roundTicks(low, high)) {
    group.append(svg("line", { x1: PLOT.left, x2: PLOT.right, y1: y(hu), y2: y(hu) }));
    group.append(svg("text", { x: PLOT.left - 8, y: y(hu) + 4, "text-anchor": "end" }, signedText(hu)));
  }
  const middle = (PLOT.left + PLOT.right) / 2;
  group.append(svg("text", { x: middle, y: PLOT.bottom + 40, "text-anchor": "middle" }, "along the line, mm"));
  group.append(svg("text", { x: -150, y: 13, transform: "rotate(-90)", "text-anchor": "middle" }, "HU"));
  return group;
}

function showEnds() {
  state.line.forEach((end, i) => end.forEach((value, k) => {
    const input = byId(`line-${i}-${k}`);
    input.max = (k ? scene.case.rows : scene.case.cols) - 1;
    if (document.activeElement !== input) input.value = value;
  }));
}

function setUpProfile() {
  for (const i of [0, 1]) {
    for (const k of [0, 1]) {
      byId(`line-${i}-${k}`).addEventListener("input", ({ target }) => {
        if (!scene || !Number.isFinite(target.valueAsNumber)) return;
        const line = state.line.map((end) => [...end]);
        line[i][k] = between(0, Math.round(target.valueAsNumber), Number(target.max));
        update({ line, drawn: true });
      });
    }
  }
}
