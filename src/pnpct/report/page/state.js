// What is shown, and who must know when that changes. Everything is drawn from here, at most once a frame.

const data = JSON.parse(document.getElementById("viewer-data").textContent);
const labelOf = Object.fromEntries(data.methods.map((method) => [method.name, method.label]));
const styleOf = Object.fromEntries(data.methods.map((method) => [method.name, method.style]));

const state = {
  case: 0,
  level: data.window[0],
  width: data.window[1],
  mode: "image", // or "truth", "reference": minus that image
  overlay: "",
  drag: "window",
  zoom: 1,
  middle: [0, 0], // of the view, in pixels from the upper left corner of the image
  cursor: null, // column and row
  marks: true, // boxes of details and the line
  line: [[0, 0], [0, 0]], // columns and rows of the ends of the profile
  drawn: false, // whether the reader has set the line: then another case of the same size keeps it
  pair: { a: "", b: "", mode: "swipe", share: 0.5, flipped: false },
};

// The case that is shown: its facts, and the pixels of its images by method.
let scene = null;

const drawers = [];
let scheduled = false;

function onChange(draw) {
  drawers.push(draw);
}

// A drawer that does nothing as long as what it depends on is the same.
function whenChanged(keyOf, draw) {
  let drawn = "";
  return () => {
    const key = JSON.stringify(keyOf());
    if (key !== drawn) draw();
    drawn = key;
  };
}

function update(changes) {
  Object.assign(state, changes);
  if (scheduled) return;
  scheduled = true;
  requestAnimationFrame(() => {
    scheduled = false;
    if (scene) drawers.forEach((draw) => draw());
  });
}

function between(low, value, high) {
  return Math.min(high, Math.max(low, value));
}

function setWindow(level, width) {
  update({ level: Math.round(between(-2000, level, 4000)), width: Math.round(between(1, width, 6000)) });
}

// Zoom by a factor; the pixel under `at` stays where it is.
function zoomBy(factor, at = state.middle) {
  const zoom = between(1, state.zoom * factor, 40);
  const shrink = state.zoom / zoom;
  moveTo(at[0] + (state.middle[0] - at[0]) * shrink, at[1] + (state.middle[1] - at[1]) * shrink, zoom);
}

// Show this place of the image in the middle, as far as the image goes.
function moveTo(x, y, zoom = state.zoom) {
  const { cols, rows } = scene.case;
  const [halfX, halfY] = [cols / zoom / 2, rows / zoom / 2];
  update({ zoom, middle: [between(halfX, x, cols - halfX), between(halfY, y, rows - halfY)] });
}

function setCursor(col, row) {
  const { cols, rows } = scene.case;
  update({ cursor: [between(0, Math.floor(col), cols - 1), between(0, Math.floor(row), rows - 1)] });
}

// Load all images of a case and show it; what was asked for last wins.
let asked = 0;

async function showCase(number) {
  const ticket = ++asked;
  const chosen = data.cases[number];
  const images = {};
  await Promise.all(chosen.order.map(async (name) => {
    images[name] = await pixelsOf(chosen.images[name].pixels, chosen.rows, chosen.cols);
  }));
  if (ticket !== asked) return;
  const same = scene && scene.case.rows === chosen.rows && scene.case.cols === chosen.cols;
  scene = { case: chosen, images, maps: {} };
  if (!same) update({ zoom: 1, middle: [chosen.cols / 2, chosen.rows / 2], cursor: null });
  if (state.mode !== "image" && !images[state.mode]) state.mode = "image";
  const keep = same && state.drawn;
  update({ case: number, drawn: keep, line: keep ? state.line : firstLine(chosen) });
  await loadMaps();
  document.documentElement.dataset.ready = chosen.name;
}

// The maps of the chosen overlay, if the case has them.
async function loadMaps() {
  const current = scene;
  const { case: shown, maps } = current;
  for (const name of shown.order) {
    const map = shown.images[name].maps[state.overlay];
    if (map && !maps[map.pixels]) {
      const [rows, cols] = [shown.rows, shown.cols].map((size) => Math.ceil(size / map.side));
      maps[map.pixels] = { ...map, rows, cols, values: await pixelsOf(map.pixels, rows, cols) };
    }
  }
  if (current === scene) update({});
}

// The map of a method under the chosen overlay, once it is loaded.
function mapOf(name) {
  const map = scene.case.images[name].maps[state.overlay];
  return map ? scene.maps[map.pixels] : undefined;
}

// Across the first detail, or the middle.
function firstLine({ details, rows, cols }) {
  const [row, col, size] = details[0] || [Math.floor(rows / 2), Math.floor(cols / 4), 0];
  const middle = Math.floor(row + size / 2);
  const [from, to] = size ? [col - size, col + 2 * size] : [col, cols - col];
  return [[between(0, from, cols - 1), middle], [between(0, to, cols - 1), middle]];
}
