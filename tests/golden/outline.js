// What a page shows, in the order of the document: texts, pictures, charts and controls. Any browser says the same of the
// same page, in any window.
() => {
  const clean = (text) => text.replace(/\s+/g, " ").trim();
  const told = (element) => {
    if (element.parentElement.closest(".chart svg")) return null; // what has no room in a narrow chart is left out
    switch (element.localName) {
      case "img": return element.alt;
      case "svg": return `${element.getAttribute("aria-label") ?? ""} (${element.querySelectorAll(".mark").length} marks)`;
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
    return text === null ? [] : [`${element.localName} ${clean(text)}`.trim()];
  });
}
