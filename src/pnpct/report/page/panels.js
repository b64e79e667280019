// The grid: one panel for each image of the case, all with the same window, view and crosshair.

const panels = new Map(); // by method: { canvas, output, changed }

function buildPanels() {
  const grid = byId("grid");
  for (const name of new Set(data.cases.flatMap((one) => one.order))) {
    const figure = document.createElement("figure");
    const canvas = document.createElement("canvas");
    const caption = document.createElement("figcaption");
    const label = document.createElement("span");
    const output = document.createElement("output");
    figure.className = "panel";
    figure.dataset.method = name;
    canvas.setAttribute("role", "img");
    label.textContent = labelOf[name];
    caption.append(label, output);
    figure.append(canvas, caption);
    grid.append(figure);
    panels.set(name, { figure, canvas, label, output });
    listen(canvas, grid);
  }
  listenToKeys(grid);
  new ResizeObserver(() => update({})).observe(grid);
}

function drawPanels() {
  for (const [name, { figure, canvas, label, output }] of panels) {
    figure.hidden = !scene.images[name];
    if (figure.hidden) continue;
    const place = scene.case.order.indexOf(name);
    figure.style.order = place;
    figure.classList.toggle("large", place < 2); // what is trusted most, and the best method
    drawMarks(canvas, drawPicture(canvas, name));
    canvas.setAttribute("aria-label", `${labelOf[name]}, ${scene.case.label}, ${modeText(name)}`);
    output.textContent = state.cursor ? readoutOf(name) : "";
    showChanged(label, scene.case.images[name].changed);
  }
}

function modeText() {
  if (state.mode !== "image") return `minus ${state.mode}, from −${DIFFERENCE_HU} to ${DIFFERENCE_HU} HU`;
  return `level ${signedText(state.level)}, width ${state.width} HU`;
}

function showChanged(label, changed) {
  if (!changed || label.querySelector(".changed")) return;
  const warning = document.createElement("strong");
  warning.className = "changed";
  warning.textContent = "FAIL: changed since it was measured";
  label.append(warning);
}

function indexOf([col, row]) {
  return row * scene.case.cols + col;
}

function huText(name) {
  return `${signedText(scene.images[name][indexOf(state.cursor)])} HU`;
}

function mapText({ values, step, cols, side }) {
  const [col, row] = state.cursor.map((at) => Math.floor(at / side));
  const value = values[row * cols + col];
  return value === NOTHING ? "not known" : signedText(value * step, Math.max(0, -Math.round(Math.log10(step))));
}

// HU under the crosshair, and what the difference or the overlay is there.
function readoutOf(name) {
  const index = indexOf(state.cursor);
  const texts = [huText(name)];
  if (state.mode !== "image") {
    const difference = scene.images[name][index] - scene.images[state.mode][index];
    texts.push(`Δ ${difference > 0 ? "+" : ""}${signedText(difference)}`);
  }
  const map = state.overlay && mapOf(name);
  if (map) texts.push(mapText(map));
  return texts.join(" · ");
}
