// What the frames of the feed hold. Made of the table in src/dash/frame.rs by its test; not to be edited.

export const HEADER_BYTES = 16;
export const GOES_ON = 1;
export const KIND = {
  Welcome: 1,
  Orders: 2,
  States: 3,
  Ground: 4,
  Vehicle: 5,
  Plan: 6,
  Tiles: 7,
  Stripe: 8,
  Finds: 9,
  Radio: 10,
  Timetable: 11,
  Events: 12,
  Moment: 13,
  Markers: 14,
  Track: 15,
  Marks: 16,
  Look: 17,
  Progress: 18,
  Way: 19,
};

export const STATE = [
  ["vehicle", "u8"],
  ["mode", "u8"],
  ["standsUnder", "u8"],
  ["flags", "u8"],
  ["x_mm", "i32"],
  ["y_mm", "i32"],
  ["z_mm", "i32"],
  ["heading_urad100", "u16"],
  ["sd_mm", "u16"],
  ["speed_mmps", "u16"],
  ["battery_permille", "u16"],
  ["age_ms", "u32"],
  ["waiting", "u16"],
];

export const TILE = [
  ["slice", "i16"],
  ["x", "i32"],
  ["y", "i32"],
  ["bytes", "u16"],
];

export const STRIPE = [
  ["run", "u32"],
  ["sequence", "u32"],
  ["laps", "u32"],
  ["subject", "u8"],
  ["hasDeviation", "u8"],
  ["columns", "u16"],
  ["rows", "u16"],
  ["first", "u32"],
  ["pixels", "u16"],
  ["least_x_mm", "i32"],
  ["least_y_mm", "i32"],
  ["greatest_x_mm", "i32"],
  ["greatest_y_mm", "i32"],
  ["meanStep_udb", "u32"],
  ["deviationStep_udb", "u32"],
  ["linksUsed", "u32"],
  ["linksDropped", "u32"],
];

export const PAIR = [
  ["receiver", "u8"],
  ["transmitter", "u8"],
  ["rssi_dbm", "i16"],
  ["loss_permille", "u16"],
  ["excess_ddb", "i16"],
  ["distance_mm", "u32"],
  ["age_ms", "u32"],
];
