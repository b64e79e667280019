// From text to pixels: base64, inflate, join the planes of bytes, add what the neighbours foretell.

const unpacked = new Map(); // by the name of the element, promises of Int16Arrays

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function bytesOf(base64) {
  const characters = atob(base64);
  const bytes = new Uint8Array(characters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = characters.charCodeAt(i);
  return bytes;
}

function joined(planes, rows, cols) {
  const size = rows * cols;
  const pixels = new Int16Array(size);
  for (let row = 0, i = 0; row < rows; row++) {
    for (let col = 0; col < cols; col++, i++) {
      const left = col ? pixels[i - 1] : 0;
      const above = row ? pixels[i - cols] : 0;
      const gradient = left + above - (row && col ? pixels[i - cols - 1] : 0);
      const foretold = left < above ? between(left, gradient, above) : between(above, gradient, left);
      const folded = planes[i] | (planes[size + i] << 8);
      pixels[i] = foretold + ((folded >>> 1) ^ -(folded & 1)); // the sign is in the lowest bit; wraps to 16 bits
    }
  }
  return pixels;
}

// Later cases stand behind this script: wait until the whole page has arrived if one is not here yet.
async function elementOf(id) {
  if (!document.getElementById(id) && document.readyState === "loading") {
    await new Promise((done) => document.addEventListener("DOMContentLoaded", done, { once: true }));
  }
  return document.getElementById(id);
}

function pixelsOf(id, rows, cols) {
  if (!unpacked.has(id)) {
    unpacked.set(id, elementOf(id).then(async (element) => {
      const planes = await inflate(bytesOf(element.textContent));
      element.remove(); // the pixels are kept, their text is not
      return joined(planes, rows, cols);
    }));
  }
  return unpacked.get(id);
}
