// What a page shows, in the order of the document: texts, pictures, charts and controls, each with its box in pixels of the
// whole page. Any browser says the same of the same page, but for a few pixels.
() => {
  const clean = (text) => text.replace(/\s+/g, " ").trim();
  const told = (element) => {
    switch (element.localName) {
      case "img": return element.alt;
      case "svg": return `${element.getAttribute("aria-label") ?? ""} (${element.querySelectorAll(".mark").length} marks, ${element.querySelectorAll("path, line, polyline").length} lines)`;
      case "progress": return `${element.getAttribute("aria-label")}: ${element.value}`;
      case "input": return element.type === "hidden" ? null : `${element.type} ${element.value || element.placeholder}`;
      case "select": return element.selectedOptions[0]?.textContent ?? "";
      case "option": return null;
      default: {
        const own = [...element.childNodes].filter((node) => node.nodeType === Node.TEXT_NODE).map((node) => node.textContent).join(" ");
        return clean(own) ? own : null;
      }
    }
  };
  return [...document.querySelectorAll("body *")].flatMap((element) => {
    const text = element.closest("title") || !element.checkVisibility({ visibilityProperty: true }) ? null : told(element);
    if (text === null) return [];
    const box = element.getBoundingClientRect();
    return [[element.localName, clean(text), ...[box.left + scrollX, box.top + scrollY, box.width, box.height].map(Math.round)]];
  });
}
