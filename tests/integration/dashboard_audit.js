// What is wrong with a page for those who cannot see it, or not well: names of controls, and contrast (WCAG 2, 1.4.3).
() => {
  const found = [];
  const parse = (colour) => (colour.match(/[\d.]+/g) || []).map(Number);
  const luminance = (rgb) => {
    const [r, g, b] = rgb.map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const colour = parse(getComputedStyle(at).backgroundColor);
      if (colour.length === 3 || colour[3] === 1) return colour.slice(0, 3);
    }
    return [255, 255, 255];
  };
  for (const element of document.querySelectorAll("body *")) {
    const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
    if (!own || !element.checkVisibility() || element.closest(".unseen, .skip, svg, option")) continue;
    const style = getComputedStyle(element);
    const [a, b] = [luminance(parse(style.color).slice(0, 3)), luminance(behind(element))].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    const needed = parseFloat(style.fontSize) >= 24 ? 3 : 4.5;
    if (ratio < needed) found.push(`contrast ${ratio.toFixed(2)}: ${element.textContent.trim().slice(0, 40)}`);
  }
  for (const control of document.querySelectorAll("input:not([type=hidden]), select, textarea")) {
    if (!control.labels?.length && !control.ariaLabel) found.push(`no label: ${control.name}`);
  }
  for (const control of document.querySelectorAll("a, button, progress, [role=img], [role=group]")) {
    const pictured = [...control.querySelectorAll("img")].some((image) => image.alt);
    if (!control.textContent.trim() && !control.ariaLabel && !pictured) found.push(`no name: ${control.outerHTML.slice(0, 60)}`);
  }
  for (const one of document.querySelectorAll("[id]")) {
    if (document.querySelectorAll(`#${CSS.escape(one.id)}`).length > 1) found.push(`id twice: ${one.id}`);
  }
  return found;
};
