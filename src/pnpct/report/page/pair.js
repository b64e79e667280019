// Two methods in one place: a divider to drag, or one after the other.

const FLICKER_MS = 700; // below three changes a second
let timer = 0;

function buildPair() {
  const area = byId("pair");
  const canvas = area.querySelector("canvas");
  listen(canvas, area, (event) => nearDivider(canvas, event) && (() => {
    const move = (next) => setShare((next.clientX - canvas.getBoundingClientRect().left) / canvas.clientWidth);
    move(event);
    return move;
  })());
  listenToKeys(area);
  new ResizeObserver(() => update({})).observe(area);
  for (const side of ["a", "b"]) {
    const select = byId(`pair-${side}`);
    select.addEventListener("change", () => setPair({ [side]: select.value }));
  }
  chosen("pair", (mode) => {
    setPair({ mode, flipped: false });
    clearInterval(timer);
    // Who wants less motion flips by hand.
    if (mode === "flicker" && !matchMedia("(prefers-reduced-motion: reduce)").matches) timer = setInterval(flip, FLICKER_MS);
  });
  byId("swipe").addEventListener("input", () => setShare(byId("swipe").valueAsNumber / 100));
  byId("flip").addEventListener("click", () => {
    clearInterval(timer);
    flip();
  });
}

function setPair(changes) {
  update({ pair: { ...state.pair, ...changes } });
}

function setShare(share) {
  setPair({ share: between(0, share, 1) });
}

function flip() {
  setPair({ flipped: !state.pair.flipped });
}

function nearDivider(canvas, event) {
  if (state.pair.mode !== "swipe") return false;
  const box = canvas.getBoundingClientRect();
  return Math.abs(event.clientX - box.left - state.pair.share * box.width) < 14;
}

// First what is trusted most against the best method; a choice stays as long as the case has its images.
function choosePair() {
  const { order } = scene.case;
  const pair = { ...state.pair };
  if (!order.includes(pair.a)) pair.a = order[0];
  if (!order.includes(pair.b)) pair.b = order[1] || order[0];
  state.pair = pair;
  for (const side of ["a", "b"]) {
    const select = byId(`pair-${side}`);
    const names = order.join(" ");
    if (select.dataset.names !== names) {
      select.replaceChildren(...order.map((name) => new Option(labelOf[name], name)));
      select.dataset.names = names;
    }
    select.value = pair[side];
  }
}

function drawPair() {
  choosePair();
  const { a, b, mode, share, flipped } = state.pair;
  const canvas = byId("pair").querySelector("canvas");
  const swipe = mode === "swipe";
  if (swipe) {
    drawPicture(canvas, a, 0, share);
    drawMarks(canvas, drawPicture(canvas, b, share, 1));
    const context = canvas.getContext("2d");
    const x = share * canvas.width;
    stroke(context, devicePixelRatio, "#ffd23f", () => {
      context.moveTo(x, 0);
      context.lineTo(x, canvas.height);
      context.moveTo(x + 7 * devicePixelRatio, canvas.height / 2);
      context.arc(x, canvas.height / 2, 7 * devicePixelRatio, 0, 2 * Math.PI);
    });
  } else {
    drawMarks(canvas, drawPicture(canvas, flipped ? b : a));
  }
  byId("swipe-label").hidden = !swipe;
  byId("flip").hidden = swipe;
  byId("swipe").value = Math.round(100 * share);
  byId("pair-left").textContent = swipe || !flipped ? labelOf[a] : "";
  byId("pair-right").textContent = swipe || flipped ? labelOf[b] : "";
}
