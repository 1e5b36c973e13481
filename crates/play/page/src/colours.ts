// One colour for one thing, in space, in charts and in words: those of the style sheet, light or dark.

export type Colour = "fixed" | "inside" | "edge" | "moving" | "moving-edge" | "hand" | "force"
    | "torque" | "energy" | "curve" | "soft" | "line" | "positive" | "negative";

const style = getComputedStyle(document.documentElement);

export const css = (colour: Colour): string => style.getPropertyValue(`--${colour}`).trim();

export const hex = (colour: Colour): number => parseInt(css(colour).slice(1), 16);

/** Calls when the screen turns dark, or light. */
export function onScheme(change: () => void): void {
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", change);
}
