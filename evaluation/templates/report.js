// A picture opens in full size on a click. Left and right step through the techniques at the same place on the
// screen, up and down through the kinds of picture: differences show as flicker.
const dialog = document.querySelector("dialog");
const shown = dialog.querySelector("img");
const caption = dialog.querySelector("p");
let current = null;

function show(image) {
  if (!image) return;
  current = image;
  shown.src = image.src;
  shown.alt = caption.textContent = image.alt;
  if (!dialog.open) dialog.showModal();
}

function neighbour(image, rows, columns) {
  const [row, column] = [Number(image.dataset.row) + rows, Number(image.dataset.column) + columns];
  return image.closest(".plate").querySelector(`img[data-row="${row}"][data-column="${column}"]`);
}

document.addEventListener("click", (event) => {
  if (event.target.matches(".plate img")) show(event.target);
  else if (dialog.open) dialog.close();
});
document.addEventListener("keydown", (event) => {
  if (event.key === "Enter" && event.target.matches(".plate img")) return show(event.target);
  const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
  if (!dialog.open || !step) return;
  event.preventDefault();
  show(neighbour(current, ...step));
});
