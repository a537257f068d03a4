/** What is on the screen, for tests and scripts to look at; nothing can be changed through it. */

/**
 * Make `window.ssiamLive`: `step`, the header of the step that is shown, or null; `boxes`, the
 * targets of it that are not lost; `frozen`, whether the picture stands still for a stroke.
 * @param {{shown: object | null, frozen: boolean}} live
 */
export function expose(live) {
  const followed = () => live.shown?.targets.filter(({ lost }) => !lost) ?? [];
  const hook = {
    get step() {
      return structuredClone(live.shown);
    },
    get boxes() {
      return followed().map(({ id, name, box }) => ({ id, name, box: [...box] }));
    },
    get frozen() {
      return live.frozen;
    },
  };
  Object.defineProperty(window, "ssiamLive", { value: Object.freeze(hook) });
}
