// Numbers and events as people write them.

/** With a minus sign, not a hyphen, and no minus before zero. */
export function fixed(value: number, digits: number): string {
    const text = value.toFixed(digits);
    return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "\u2212");
}

/** A tick of a chart. */
export const tick = (value: number): string => String(value).replace("-", "\u2212");

/** What happened, and what to do about it: nothing, if there are no words for it. */
export type Words = [what: string, help: string];

const BUSY = "Close what keeps this machine busy.";

/** Of the flags, in the order of their bits. */
export const EVENTS: Words[] = [
    ["nothing has come from the page yet", "Wait a moment, or reload the page."],
    ["the page sent a pose that is none", "Reload the page."],
    ["the page was silent, so its hand let go", `Keep this tab in front. ${BUSY}`],
    ["the hand moved faster than a hand can", "Drag more slowly."],
    ["a step of the loop came late", BUSY],
    ["there is no energy for this pose", "Move the part somewhere else."],
    ["a force was no number, and left out", "Move the part somewhere else."],
    ["pushed as hard as the loop may", "Ease off: the part is at a wall."],
    ["the force was let rise gently", ""],
    ["damped, so that nothing swings", ""],
    ["a force did not get to the hand", BUSY],
    ["a part was loaded or exchanged", ""],
    ["steps of the loop were left out", BUSY],
    ["a part in reach is still being loaded", "Wait: it pushes nothing yet."],
    ["outside of the table, where forces fade", "Come back to the other part."],
];

/** Of who has the part, for a page that has the hand: by what the hand does. */
export const HOLDS = [
    "Let go: the part follows the forces", "You hold the part", "The collision test holds the part",
    "The snap test holds the part", "The recording holds the part", "The path's hand holds the part",
];
