// Everything is set up once; then the first case is shown.

setUpTheme();
if (typeof DecompressionStream === "undefined") {
  complain("this browser is too old; it needs DecompressionStream (Chrome 80, Firefox 113, Safari 16.4 or later).");
} else if (data.cases.length) {
  setUpControls();
  setUpProfile();
  buildPanels();
  buildPair();
  const onlyForLine = whenChanged(() => [state.case, state.line], drawProfile);
  const onlyForLook = whenChanged(() => [state.case, state.level, state.width, state.mode, state.overlay, Object.keys(scene.maps)], drawDetails);
  [drawPanels, drawPair, onlyForLook, onlyForLine, showControls].forEach(onChange);
  showCase(0).catch(complain);
}
