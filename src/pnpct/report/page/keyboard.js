// Keys, while the images have the focus.

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const MOVES = { a: [-1, 0], d: [1, 0], w: [0, -1], s: [0, 1] };

const KEYS = {
  "+": () => zoomBy(1.25, cursorPlace()),
  "=": () => zoomBy(1.25, cursorPlace()),
  "-": () => zoomBy(0.8, cursorPlace()),
  "0": () => moveTo(scene.case.cols / 2, scene.case.rows / 2, 1),
  "[": () => setWindow(state.level - 10, state.width),
  "]": () => setWindow(state.level + 10, state.width),
  "{": () => setWindow(state.level, state.width / 1.1 - 1),
  "}": () => setWindow(state.level, state.width * 1.1 + 1),
  n: () => chooseCase(state.case + 1),
  p: () => chooseCase(state.case - 1),
  m: () => update({ mode: state.mode === "image" ? (scene.images.truth ? "truth" : scene.images.reference ? "reference" : "image") : "image" }),
};

function listenToKeys(area) {
  area.addEventListener("keydown", (event) => {
    if (!scene || event.ctrlKey || event.altKey || event.metaKey) return;
    const act = actionOf(event);
    if (!act) return;
    event.preventDefault();
    act();
  });
}

function actionOf({ key, shiftKey }) {
  if (ARROWS[key]) return () => step(ARROWS[key], shiftKey ? 10 : 1);
  if (MOVES[key]) {
    const quarter = scene.case.cols / state.zoom / 8;
    return () => moveTo(state.middle[0] + MOVES[key][0] * quarter, state.middle[1] + MOVES[key][1] * quarter);
  }
  const preset = document.querySelectorAll("#presets button")[Number(key) - 1];
  if (preset) return () => preset.click();
  return KEYS[key];
}

// Move the crosshair, keep it in view, and say what is there.
function step([across, down], pixels) {
  const { cols, rows } = scene.case;
  const [col, row] = state.cursor || [Math.floor(cols / 2), Math.floor(rows / 2)];
  setCursor(col + across * pixels, row + down * pixels);
  const [halfX, halfY] = [cols / state.zoom / 2, rows / state.zoom / 2];
  const [x, y] = state.cursor;
  moveTo(between(x + 1 - halfX, state.middle[0], x + halfX), between(y + 1 - halfY, state.middle[1], y + halfY));
  document.getElementById("said").textContent =
    `Column ${x}, row ${y}: ${scene.case.order.map((name) => `${labelOf[name]} ${huText(name)}`).join(", ")}`;
}

function cursorPlace() {
  return state.cursor ? state.cursor.map((v) => v + 0.5) : state.middle;
}
