// The squares of a case, enlarged three times, method beside method.

const ENLARGED = 3;

function drawDetails() {
  const rows = byId("detail-rows");
  if (!rows) return;
  const key = `${scene.case.name}|${scene.case.order.join(" ")}`;
  if (rows.dataset.key !== key) {
    rows.dataset.key = key;
    rows.replaceChildren(...scene.case.details.map(detailRow));
  }
  for (const canvas of rows.querySelectorAll("canvas")) drawDetail(canvas);
}

function detailRow([row, col, size], number) {
  const section = document.createElement("div");
  const title = document.createElement("h3");
  const list = document.createElement("div");
  section.className = "detail-row";
  title.textContent = `${number + 1}: rows ${row} to ${row + size - 1}, columns ${col} to ${col + size - 1}`;
  for (const name of scene.case.order) {
    const figure = document.createElement("figure");
    const canvas = document.createElement("canvas");
    const caption = document.createElement("figcaption");
    figure.className = "panel";
    Object.assign(canvas.dataset, { method: name, row, col, size });
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `Detail ${number + 1} of ${labelOf[name]}`);
    caption.textContent = labelOf[name];
    figure.append(canvas, caption);
    list.append(figure);
  }
  section.append(title, list);
  return section;
}

function drawDetail(canvas) {
  const [row, col, size] = ["row", "col", "size"].map((key) => Number(canvas.dataset[key]));
  const side = Math.round(ENLARGED * size * devicePixelRatio);
  if (canvas.width !== side) [canvas.width, canvas.height] = [side, side];
  canvas.style.maxWidth = `${Math.max(ENLARGED * size, 160)}px`;
  const context = canvas.getContext("2d");
  const picture = pictureOf(canvas.dataset.method);
  context.imageSmoothingQuality = "high";
  context.drawImage(picture.canvas, col, row, size, size, 0, 0, side, side);
  if (picture.covered) drawCover(context, canvas.dataset.method, [col, row, size, size], [0, 0, side, side]);
}
