/** Keys of the page: single ones, where nothing is being typed or chosen. */

/** @param {Object<string, function(): void>} actions  by key as KeyboardEvent.key has it, letters small */
export function listenToKeys(actions) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.isComposing) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const { target } = event;
    const isField = target.matches("input, select, textarea");
    if (isField && key !== "Escape") return;
    // What has the focus answers to these itself.
    const isControl = target.matches("button, summary, a");
    if (isControl && (key === "Enter" || key.startsWith("Arrow"))) return;
    const action = actions[key];
    if (action === undefined) return;
    event.preventDefault();
    action();
  });
}
