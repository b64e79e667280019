// Tables from values to colours, as 32-bit pixels of a canvas.

const HU_OFFSET = 32768;
const DIFFERENCE_HU = 100;
const NOTHING = -32768; // in a map: nothing is known there

function rgb(red, green, blue) {
  return ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0; // canvases are little-endian RGBA
}

// Grey of each 16-bit HU: 0 to 255 over the window.
function greyTable(level, width) {
  const table = new Uint32Array(65536);
  for (let i = 0; i < 65536; i++) {
    const shown = (i - HU_OFFSET - level) / width + 0.5;
    const grey = Math.round(255 * Math.min(1, Math.max(0, shown)));
    table[i] = rgb(grey, grey, grey);
  }
  return table;
}

// Colours between given ones, at equal distances.
function blend(stops, steps) {
  const table = new Uint32Array(steps);
  for (let i = 0; i < steps; i++) {
    const at = (i / (steps - 1)) * (stops.length - 1);
    const first = Math.min(Math.floor(at), stops.length - 2);
    const part = at - first;
    const mixed = [0, 1, 2].map((k) => Math.round(stops[first][k] * (1 - part) + stops[first + 1][k] * part));
    table[i] = rgb(...mixed);
  }
  return table;
}

// Blue, white, red: told apart by those who do not see red and green.
const DIVERGING = blend([[5, 48, 97], [67, 147, 195], [247, 247, 247], [214, 96, 77], [103, 0, 31]], 201);
// Dark blue to yellow, of growing lightness (after viridis).
const SEQUENTIAL = blend([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]], 256);

// One canvas row that shows a table.
function drawScale(canvas, table) {
  canvas.width = table.length;
  canvas.height = 1;
  const context = canvas.getContext("2d");
  context.putImageData(new ImageData(new Uint8ClampedArray(table.buffer.slice(0)), table.length, 1), 0, 0);
}

function signedText(value, digits = 0) {
  return value.toFixed(digits).replace("-", "−");
}
