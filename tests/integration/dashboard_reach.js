// What is wrong with a page for those who use the keyboard or see little, beyond names and texts: charts and borders of
// controls (WCAG 2, 1.4.3 and 1.4.11), what scrolls (2.1.1), headings (1.3.1), and what moves though it should not (2.3.3).
() => {
  const found = [];
  const parse = (colour) => (colour.match(/[\d.]+/g) || []).map(Number);
  const luminance = (rgb) => {
    const [r, g, b] = rgb.map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const contrast = (one, two) => {
    const [a, b] = [luminance(one), luminance(two)].sort((x, y) => y - x);
    return (a + 0.05) / (b + 0.05);
  };
  const behind = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const colour = parse(getComputedStyle(at).backgroundColor);
      if (colour.length === 3 || colour[3] === 1) return colour.slice(0, 3);
    }
    return [255, 255, 255];
  };
  const require = (least, colour, element, what) => {
    const [r, g, b, a = 1] = parse(colour);
    const under = behind(element);
    const seen = [r, g, b].map((v, i) => a * v + (1 - a) * under[i]);
    const ratio = contrast(seen, under);
    if (ratio < least) found.push(`contrast ${ratio.toFixed(2)} of ${what}: ${element.outerHTML.slice(0, 60)}`);
  };
  for (const text of document.querySelectorAll(".chart svg text")) {
    require(4.5, getComputedStyle(text).fill, text, `the text ${text.textContent.slice(0, 20)}`);
  }
  for (const mark of document.querySelectorAll(".chart svg .mark")) {
    const style = getComputedStyle(mark);
    require(3, style.fill === "none" ? style.stroke : style.fill, mark, "a mark");
  }
  for (const control of document.querySelectorAll("input:not([type=hidden], [type=radio], [type=checkbox], [type=range]), select, textarea")) {
    if (control.checkVisibility()) require(3, getComputedStyle(control).borderTopColor, control.parentElement, `the border of ${control.name}`);
  }
  const stops = "a[href], button, input, select, textarea, summary, [tabindex]";
  for (const box of document.querySelectorAll("body *")) {
    const style = getComputedStyle(box);
    // What a closed `details` hides cannot be scrolled by anybody.
    const scrolls = box.checkVisibility() && (
      (/auto|scroll/.test(style.overflowX) && box.scrollWidth > box.clientWidth + 1) ||
      (/auto|scroll/.test(style.overflowY) && box.scrollHeight > box.clientHeight + 1));
    if (scrolls && box.tabIndex < 0 && !box.querySelector(stops)) found.push(`not to be scrolled by keyboard: ${box.outerHTML.slice(0, 60)}`);
    const moves = style.animationName !== "none" || style.transitionDuration.split(", ").some((one) => parseFloat(one) > 0);
    if (matchMedia("(prefers-reduced-motion: reduce)").matches && (moves || style.scrollBehavior !== "auto")) {
      found.push(`moves: ${box.outerHTML.slice(0, 60)}`);
    }
  }
  let level = 0;
  for (const heading of document.querySelectorAll("h1, h2, h3, h4, h5, h6")) {
    const own = Number(heading.tagName[1]);
    if (own > level + 1) found.push(`a level of headings is left out before: ${heading.textContent.trim().slice(0, 40)}`);
    level = own;
  }
  for (const [what, selector] of [["main", "main"], ["h1", "h1"], ["skip link", "body > a.skip:first-child"]]) {
    if (document.querySelectorAll(selector).length !== 1) found.push(`not one ${what}`);
  }
  if (!document.documentElement.lang || !document.title) found.push("no language or no title");
  return found;
};
