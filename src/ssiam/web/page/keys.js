/** The keyboard. */

/**
 * Watch the keys of the page, but for those typed into a field or meant for a button.
 * @param {Record<string, () => void>} actions by the key's name
 */
export function watchKeys(actions) {
  const help = document.getElementById("help");
  const openHelp = () => help.showModal();
  document.getElementById("help-button").addEventListener("click", openHelp);
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.repeat || help.open) return;
    if (isTaken(event)) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const action = { ...actions, "?": openHelp }[key];
    if (!action) return;
    event.preventDefault();
    action();
  });
}

/** Whether the key is for what has the focus. */
function isTaken({ key, target }) {
  if (target.matches("input[type=text]")) return true;
  return key === " " && target.matches("button, input, a, video");
}
