// Pointer and wheel on an image. `special` may take a drag before the others: it gets the event and returns a follower.

function listen(canvas, area, special = () => null) {
  let follow = null;
  canvas.addEventListener("pointermove", (event) => {
    if (!scene) return;
    if (follow) follow(event);
    else setCursor(...placeIn(canvas, event));
  });
  canvas.addEventListener("pointerdown", (event) => {
    if (!scene || event.button > 1) return;
    area.focus({ preventScroll: true });
    follow = special(event) || dragOf(event)(canvas, event);
    canvas.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { follow = null; });
  canvas.addEventListener("wheel", (event) => {
    // Until the images have been clicked the wheel scrolls the page.
    if (!scene || !(area.contains(document.activeElement) || event.ctrlKey)) return;
    event.preventDefault();
    zoomBy(Math.exp(-event.deltaY / (event.deltaMode ? 15 : 500)), placeIn(canvas, event));
  }, { passive: false });
}

function dragOf(event) {
  if (event.shiftKey || event.button === 1 || state.drag === "move") return dragView;
  return state.drag === "line" ? dragLine : dragWindow;
}

// To the right the window widens, downwards its level rises: 300 dots for its own width.
function dragWindow(canvas, start) {
  const { level, width } = state;
  return (event) => {
    const [across, down] = [event.clientX - start.clientX, event.clientY - start.clientY];
    setWindow(level + (down * width) / 300, width * Math.exp(across / 300));
  };
}

function dragView(canvas, start) {
  const grabbed = placeIn(canvas, start);
  return (event) => {
    const [x, y] = placeIn(canvas, event);
    moveTo(state.middle[0] + grabbed[0] - x, state.middle[1] + grabbed[1] - y);
  };
}

// Near an end of the line that end is taken; elsewhere a new line begins.
function dragLine(canvas, start) {
  const place = placeIn(canvas, start);
  const near = (12 / canvas.clientWidth) * (scene.case.cols / state.zoom);
  const taken = state.line.findIndex(([col, row]) => Math.hypot(col + 0.5 - place[0], row + 0.5 - place[1]) < near);
  const fixed = taken < 0 ? pixelAt(place) : state.line[1 - taken];
  return (event) => {
    const moved = pixelAt(placeIn(canvas, event));
    update({ line: taken === 0 ? [moved, fixed] : [fixed, moved], drawn: true });
  };
}

function pixelAt([x, y]) {
  const { cols, rows } = scene.case;
  return [between(0, Math.floor(x), cols - 1), between(0, Math.floor(y), rows - 1)];
}
