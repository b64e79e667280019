// An image as it is shown: windowed, minus another or under a map; painted anew only when that changes.

class Picture {
  constructor(name) {
    this.name = name;
    this.canvas = document.createElement("canvas");
    this.cover = document.createElement("canvas");
    this.painted = "";
    this.covered = "";
  }

  paint() {
    const { level, width, mode, overlay } = state;
    const key = [scene.case.name, mode === "image" ? `${level} ${width}` : mode].join("|");
    if (key !== this.painted) {
      this.painted = key;
      fill(this.canvas, mode === "image" ? this.greys() : this.differences(mode));
    }
    const map = overlay && mapOf(this.name);
    const wanted = map ? `${scene.case.name}|${overlay}` : "";
    if (wanted && wanted !== this.covered) fill(this.cover, mapColours(map, scene.case.scales[overlay]), map.rows, map.cols);
    this.covered = wanted;
  }

  greys() {
    const table = windowTable();
    return (index) => table[scene.images[this.name][index] + HU_OFFSET];
  }

  differences(other) {
    const [pixels, minus] = [scene.images[this.name], scene.images[other]];
    return (index) => DIVERGING[between(-DIFFERENCE_HU, pixels[index] - minus[index], DIFFERENCE_HU) + DIFFERENCE_HU];
  }
}

let table = null;
let tableOf = "";

function windowTable() {
  const key = `${state.level} ${state.width}`;
  if (key !== tableOf) [tableOf, table] = [key, greyTable(state.level, state.width)];
  return table;
}

function fill(canvas, colourOf, rows = scene.case.rows, cols = scene.case.cols) {
  [canvas.width, canvas.height] = [cols, rows];
  const colours = new Uint32Array(rows * cols);
  for (let i = 0; i < colours.length; i++) colours[i] = colourOf(i);
  canvas.getContext("2d").putImageData(new ImageData(new Uint8ClampedArray(colours.buffer), cols, rows), 0, 0);
}

// All maps of a case have one scale. A signed map fades out towards 0, so that the image is seen where nothing is amiss;
// where nothing is known no map covers it.
function mapColours({ values, step }, { signed, largest }) {
  return (index) => {
    if (values[index] === NOTHING) return 0;
    const share = between(-1, (values[index] * step) / largest, 1);
    if (!signed) return SEQUENTIAL[Math.round(255 * Math.max(0, share))];
    const alpha = Math.round(255 * Math.min(1, 1.2 * Math.abs(share)));
    return ((DIVERGING[Math.round(100 * share) + 100] & 0xffffff) | (alpha << 24)) >>> 0;
  };
}

// Pictures of the case that is shown, by method.
const pictures = new Map();

function pictureOf(name) {
  if (!pictures.has(name)) pictures.set(name, new Picture(name));
  const picture = pictures.get(name);
  picture.paint();
  return picture;
}

// Canvas pixels for one image pixel; the canvas gets the size it has on the screen.
function fit(canvas) {
  const { rows, cols } = scene.case;
  canvas.style.aspectRatio = `${cols} / ${rows}`;
  const dots = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio));
  const height = Math.round((dots * rows) / cols);
  if (canvas.width !== dots || canvas.height !== height) [canvas.width, canvas.height] = [dots, height];
  return (dots / cols) * state.zoom;
}

// Draw the part of a picture that is in view, from one place across to another (both from 0 to 1).
function drawPicture(canvas, name, from = 0, to = 1) {
  const scale = fit(canvas);
  const context = canvas.getContext("2d");
  const picture = pictureOf(name);
  context.save();
  context.beginPath();
  context.rect(from * canvas.width, 0, (to - from) * canvas.width, canvas.height);
  context.clip();
  context.fillStyle = "#000";
  context.fillRect(0, 0, canvas.width, canvas.height);
  // Below four dots for a pixel they are smoothed; above, pixels show as they are.
  context.imageSmoothingEnabled = scale < 4;
  context.imageSmoothingQuality = "high";
  context.translate(canvas.width / 2, canvas.height / 2);
  context.scale(scale, scale);
  context.translate(-state.middle[0], -state.middle[1]);
  context.drawImage(picture.canvas, 0, 0);
  if (picture.covered) {
    drawCover(context, name, [0, 0, scene.case.cols, scene.case.rows], [0, 0, scene.case.cols, scene.case.rows]);
  }
  context.restore();
  return scale;
}

// A part of the map over an image, left, top, width and height in the image's pixels, to a place on a canvas.
function drawCover(context, name, part, place) {
  const { side } = mapOf(name);
  context.globalAlpha = 0.6;
  context.drawImage(pictureOf(name).cover, ...part.map((value) => value / side), ...place);
  context.globalAlpha = 1;
}

// From a pointer to columns and rows, fractions included.
function placeIn(canvas, event) {
  const box = canvas.getBoundingClientRect();
  const scale = (box.width / scene.case.cols) * state.zoom;
  return [
    (event.clientX - box.left - box.width / 2) / scale + state.middle[0],
    (event.clientY - box.top - box.height / 2) / scale + state.middle[1],
  ];
}
