// The controls above the images: from them to the state, and back.

const byId = (id) => document.getElementById(id);

function chosen(name, act) {
  for (const input of document.querySelectorAll(`input[name="${name}"]`)) {
    input.addEventListener("change", () => act(input.value));
  }
}

function chooseCase(number) {
  const next = (number + data.cases.length) % data.cases.length;
  showCase(next).catch(complain);
}

function setUpControls() {
  chosen("case", (value) => chooseCase(Number(value)));
  chosen("mode", (mode) => update({ mode }));
  chosen("drag", (drag) => update({ drag }));
  chosen("overlay", (overlay) => {
    update({ overlay });
    loadMaps().catch(complain);
  });
  byId("marks").addEventListener("change", () => update({ marks: byId("marks").checked }));
  for (const button of document.querySelectorAll("#presets button")) {
    button.addEventListener("click", () => setWindow(Number(button.dataset.level), Number(button.dataset.width)));
  }
  byId("level").addEventListener("input", () => setWindow(byId("level").valueAsNumber, state.width));
  byId("width").addEventListener("input", () => setWindow(state.level, byId("width").valueAsNumber));
  const zooms = {
    in: () => zoomBy(1.5, cursorPlace()),
    out: () => zoomBy(1 / 1.5, cursorPlace()),
    fit: KEYS["0"],
    pixels: () => zoomBy(scene.case.cols / onePanelWidth() / state.zoom, cursorPlace()),
  };
  for (const button of document.querySelectorAll("#zooms button")) {
    button.addEventListener("click", () => scene && zooms[button.dataset.zoom]());
  }
}

function onePanelWidth() {
  return document.querySelector(".panel canvas").clientWidth * devicePixelRatio;
}

function showControls() {
  const { level, width, mode, overlay, drag } = state;
  [byId("level").value, byId("width").value] = [level, width];
  byId("level-says").value = `${signedText(level)} HU`;
  byId("width-says").value = `${width} HU`;
  for (const [name, value] of Object.entries({ case: state.case, mode, overlay, drag })) {
    for (const input of document.querySelectorAll(`input[name="${name}"]`)) input.checked = input.value === String(value);
  }
  for (const other of ["truth", "reference"]) document.querySelector(`input[name="mode"][value="${other}"]`).disabled = !scene.images[other];
  for (const input of document.querySelectorAll('input[name="overlay"]')) {
    input.disabled = input.value !== "" && !scene.case.order.some((name) => scene.case.images[name].maps[input.value]);
  }
  for (const button of document.querySelectorAll("#presets button")) {
    const same = Number(button.dataset.level) === level && Number(button.dataset.width) === width;
    button.setAttribute("aria-pressed", String(same));
  }
  byId("grid").dataset.drag = drag;
  showScale();
  showPlace();
}

// What grey or colour means: that of the overlay where there is one.
function showScale() {
  const scale = scene.case.scales[state.overlay];
  if (scale && scene.case.order.some((name) => mapOf(name))) {
    drawScale(byId("scale"), scale.signed ? DIVERGING : SEQUENTIAL);
    const shown = Number(scale.largest.toPrecision(3));
    const end = scale.beyond ? `${shown} and more` : shown;
    return scaleText(scale.signed ? `−${end}` : "0", `${end} (${state.overlay.replaceAll("_", " ")})`);
  }
  if (state.mode !== "image") {
    drawScale(byId("scale"), DIVERGING);
    return scaleText(`−${DIFFERENCE_HU} HU`, `+${DIFFERENCE_HU} HU (minus ${state.mode})`);
  }
  const low = Math.round(state.level - state.width / 2);
  const greys = windowTable();
  const steps = Uint32Array.from({ length: 256 }, (_, i) => greys[between(0, Math.round(low + (state.width * i) / 255) + HU_OFFSET, 65535)]);
  drawScale(byId("scale"), steps);
  return scaleText(`${signedText(state.level - state.width / 2)} HU`, `${signedText(state.level + state.width / 2)} HU`);
}

function scaleText(low, high) {
  [byId("scale-low").textContent, byId("scale-high").textContent] = [low, high];
}

function showPlace() {
  if (!state.cursor) return;
  const [col, row] = state.cursor;
  const { rows, cols, spacing, center } = scene.case;
  const x = center[0] + (col - (cols - 1) / 2) * spacing;
  const y = center[1] - (row - (rows - 1) / 2) * spacing;
  byId("place").textContent = `column ${col}, row ${row} · x ${signedText(x, 1)} mm, y ${signedText(y, 1)} mm`;
}

function complain(error) {
  byId("viewer-problem").hidden = false;
  byId("viewer-problem").textContent = `The images cannot be shown: ${error.message || error}`;
}
