// What is drawn over an image: crosshair, boxes of details and the line of the profile.

function drawMarks(canvas, scale) {
  const context = canvas.getContext("2d");
  const dots = devicePixelRatio;
  const at = ([x, y]) => [
    (x - state.middle[0]) * scale + canvas.width / 2,
    (y - state.middle[1]) * scale + canvas.height / 2,
  ];
  if (state.marks || state.drag === "line") drawLine(context, at, dots);
  if (state.marks) drawBoxes(context, at, scale, dots);
  if (state.cursor) drawCrosshair(canvas, context, at(state.cursor.map((v) => v + 0.5)), Math.max(scale, 6 * dots), dots);
}

// Dark below light, so that marks are seen on any grey.
function stroke(context, dots, colour, path) {
  for (const [style, width] of [["rgba(0, 0, 0, 0.55)", 2.6], [colour, 1.1]]) {
    context.beginPath();
    path();
    context.strokeStyle = style;
    context.lineWidth = width * dots;
    context.stroke();
  }
}

function drawBoxes(context, at, scale, dots) {
  scene.case.details.forEach(([row, col, size], number) => {
    const [x, y] = at([col, row]);
    stroke(context, dots, "#ffd23f", () => context.rect(x, y, size * scale, size * scale));
    context.font = `bold ${11 * dots}px sans-serif`;
    context.lineWidth = 3 * dots;
    context.strokeStyle = "rgba(0, 0, 0, 0.8)";
    context.strokeText(number + 1, x + 3 * dots, y + 12 * dots);
    context.fillStyle = "#ffd23f";
    context.fillText(number + 1, x + 3 * dots, y + 12 * dots);
  });
}

function drawLine(context, at, dots) {
  const ends = state.line.map(([col, row]) => at([col + 0.5, row + 0.5]));
  stroke(context, dots, "#5ec8ff", () => {
    context.moveTo(...ends[0]);
    context.lineTo(...ends[1]);
  });
  ends.forEach(([x, y]) => stroke(context, dots, "#5ec8ff", () => context.arc(x, y, 3 * dots, 0, 2 * Math.PI)));
}

// Open in the middle: the pixel itself stays visible.
function drawCrosshair(canvas, context, [x, y], gap, dots) {
  stroke(context, dots, "#ffffff", () => {
    for (const [fromX, fromY, toX, toY] of [
      [0, y, x - gap, y], [x + gap, y, canvas.width, y], [x, 0, x, y - gap], [x, y + gap, x, canvas.height],
    ]) {
      context.moveTo(fromX, fromY);
      context.lineTo(toX, toY);
    }
  });
}
