// One colour for one thing, in space, in charts and in words.

export const COLOUR = {
    fixed: 0xb9c2cd,
    inside: 0xdf9f7f,
    moving: 0x2f6fb5,
    hand: 0xd97706,
    force: 0xd33c2f,
    torque: 0x7c4dbd,
    edge: 0x334155,
};

export const CSS = { force: "#d33c2f", torque: "#7c4dbd", energy: "#0f8a72", soft: "#94a3b8" };
