// Where the keyboard is: its place among all that it should reach in the order of the document, and how it is shown.
() => {
  const all = [...document.querySelectorAll("a[href], button, input:not([type=hidden]), select, textarea, summary, [tabindex]")];
  const isOther = (one) => one.type === "radio" && !one.checked && document.querySelector(`[name="${one.name}"]:checked`);
  const stops = all.filter((one) => one.tabIndex >= 0 && !one.disabled && one.checkVisibility({ visibilityProperty: true }) && !isOther(one));
  const at = document.activeElement;
  const style = getComputedStyle(at);
  const box = at.getBoundingClientRect();
  const parse = (colour) => (colour.match(/[\d.]+/g) || []).map(Number).slice(0, 3);
  const luminance = (rgb) => {
    const [r, g, b] = rgb.map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const [a, b] = [style.outlineColor, getComputedStyle(document.body).backgroundColor].map((one) => luminance(parse(one))).sort((x, y) => y - x);
  return {
    place: stops.indexOf(at),
    stops: stops.length,
    what: at.outerHTML.slice(0, 80),
    outlined: style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2,
    contrast: (a + 0.05) / (b + 0.05),
    seen: box.bottom > 0 && box.right > 0 && box.top < innerHeight && box.left < innerWidth,
  };
};
