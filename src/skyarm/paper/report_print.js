// A printed page has no folds: what is closed is opened for the printer, and closed again.
addEventListener("beforeprint", () => {
  for (const fold of document.querySelectorAll("details:not([open])")) { fold.dataset.folded = ""; fold.open = true; }
});
addEventListener("afterprint", () => {
  for (const fold of document.querySelectorAll("details[data-folded]")) { delete fold.dataset.folded; fold.open = false; }
});
