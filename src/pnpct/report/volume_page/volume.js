"use strict";
(async () => {
  if (!document.createElement("canvas").getContext("webgl2")) {
    document.getElementById("place").textContent = "This page needs WebGL 2, which this browser has not, or not enabled.";
    return;
  }
  const { Niivue, SHOW_RENDER, SLICE_TYPE, DRAG_MODE } = niivue;
  const facts = JSON.parse(document.getElementById("facts").textContent);
  const planes = {
    "Three planes": SLICE_TYPE.MULTIPLANAR,
    Axial: SLICE_TYPE.AXIAL,
    Coronal: SLICE_TYPE.CORONAL,
    Sagittal: SLICE_TYPE.SAGITTAL,
  };
  const said = (number) => number.toFixed(0).replace("-", "−");

  const views = [];
  for (const index of facts.volumes.keys()) {
    const view = new Niivue({
      backColor: [0, 0, 0, 1],
      crosshairColor: [0.95, 0.75, 0.2, 0.7],
      crosshairGap: 8,
      crosshairWidth: 0.5,
      dragAndDropEnabled: false,
      dragMode: DRAG_MODE.none, // so that the wheel goes through the slices
      isRadiologicalConvention: true,
      loadingText: "",
      logLevel: "silent",
      multiplanarShowRender: SHOW_RENDER.NEVER,
    });
    await view.attachToCanvas(document.getElementById(`canvas-${index}`));
    const text = document.getElementById(`volume-${index}`).textContent;
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    await view.loadFromArrayBuffer(bytes.buffer, "volume.nii.gz");
    view.setInterpolation(true); // voxels as they are
    views.push(view);
  }
  for (const view of views) {
    view.broadcastTo(views.filter((other) => other !== view), { "2d": true, "3d": false });
  }

  function setWindow(level, width) {
    for (const view of views) {
      view.volumes[0].cal_min = level - width / 2;
      view.volumes[0].cal_max = level + width / 2;
      view.updateGLVolume();
    }
    document.getElementById("level").value = level;
    document.getElementById("width").value = width;
    for (const button of document.querySelectorAll("[data-level]")) {
      const pressed = Number(button.dataset.level) === level && Number(button.dataset.width) === width;
      button.setAttribute("aria-pressed", pressed);
    }
  }

  function setPlanes(name) {
    for (const view of views) view.setSliceType(planes[name]);
    for (const button of document.querySelectorAll("[data-planes]")) {
      button.setAttribute("aria-pressed", button.dataset.planes === name);
    }
  }

  // What is at a place, mm, in each volume: both have one patient, but perhaps not one grid.
  function tell(place) {
    const [x, y, z] = place;
    document.getElementById("place").textContent = `x ${said(-x)} mm, y ${said(y)} mm, z ${z.toFixed(1).replace("-", "−")} mm`;
    views.forEach((view, index) => {
      const [column, row, slice] = view.frac2vox(view.mm2frac([x, y, z]));
      const size = view.volumes[0].dims;
      const inside = [column, row, slice].every((at, axis) => at >= 0 && at < size[axis + 1]);
      document.querySelector(`[data-hu="${index}"]`).textContent = inside
        ? `${said(view.volumes[0].getValue(column, row, slice))} HU`
        : "";
    });
  }

  views.forEach((view, index) => {
    view.canvas.addEventListener("pointermove", (event) => {
      const scale = view.uiData.dpr || 1;
      const place = view.canvasPos2frac([event.offsetX * scale, event.offsetY * scale]);
      if (place[0] >= 0) tell(view.frac2mm(place));
    });
    view.onLocationChange = (location) => tell(location.mm);
  });
  for (const button of document.querySelectorAll("[data-level]")) {
    button.addEventListener("click", () => setWindow(Number(button.dataset.level), Number(button.dataset.width)));
  }
  for (const button of document.querySelectorAll("[data-planes]")) {
    button.addEventListener("click", () => setPlanes(button.dataset.planes));
  }
  for (const name of ["level", "width"]) {
    document.getElementById(name).addEventListener("change", () => {
      const [level, width] = ["level", "width"].map((which) => Number(document.getElementById(which).value));
      if (width > 0) setWindow(level, width);
    });
  }
  setWindow(...facts.window);
  setPlanes("Three planes");
  tell(views[0].frac2mm([0.5, 0.5, 0.5]));
  document.documentElement.dataset.ready = "";
})();
