// What the server tells a page as text. Made of src/dash/told.rs by its test; not to be edited.

/** What a page shows: how the time that it shows came about. */
export type Showing = "LIVE" | "SIMULATION" | "REPLAY";

/** A key of a table with what is to be known of it, as people read it. */
export type DeclaredKey = {
  /** Its name, with its unit. */
  name: string,
  /** What it is when it is left out, in words or as a value. */
  default: string,
  /** What it may be, with its unit. */
  allowed: string,
  /** What it means. */
  means: string,
};

/** What holds for the whole connection of any page. */
export type Place = {
  /** What is shown. */
  showing: Showing,
  /** The name of the venue. */
  venue: string,
  /** The side of a cell of the map, metres. */
  cell_m: number,
  /** The borders between slices of altitude, metres, ascending. */
  slices_m: Array<number>,
  /** The bearing of the x axis, degrees from north clockwise. */
  xAxis_deg: number,
  /** The corners of the area with the least and with the greatest x and y. */
  area: [[number, number], [number, number]],
  /** The corners of the fence. */
  fence: Array<[number, number]>,
  /** Where vehicles are at home, by their numbers. */
  homes: Array<[number, number]>,
  /** The words for modes, by the numbers that records have. */
  modes: Array<string>,
  /** The words for why a vehicle stands, by the numbers that records have. */
  standsUnder: Array<string>,
  /** The colours of the first vehicles: red, green, blue. */
  vehicleColours: Array<[number, number, number]>,
  /** The colours of images, from nothing to the most. */
  heat: Array<[number, number, number]>,
  /** The missions that can be begun. */
  missions: Array<DeclaredMission>,
  /** What truly stands in a simulation. */
  truth: Truth | null,
  /** Where the range sensors of simulated vehicles look. */
  sensors: Sensors | null,
  /** Another run that is shown beside this one. */
  ghost: GhostAbout | null,
};

/** The first text of a connection. */
export type Welcome = {
  /** Its number. */
  page: number,
  /** Whether its token may order. */
  mayOrder: boolean,
  /** How many tiles of the map there are. */
  tiles: number,
  /** Of which subjects there is an image. */
  images: Array<number>,
  /** What is shown. */
  showing: Showing,
  /** The name of the venue. */
  venue: string,
  /** The side of a cell of the map, metres. */
  cell_m: number,
  /** The borders between slices of altitude, metres, ascending. */
  slices_m: Array<number>,
  /** The bearing of the x axis, degrees from north clockwise. */
  xAxis_deg: number,
  /** The corners of the area with the least and with the greatest x and y. */
  area: [[number, number], [number, number]],
  /** The corners of the fence. */
  fence: Array<[number, number]>,
  /** Where vehicles are at home, by their numbers. */
  homes: Array<[number, number]>,
  /** The words for modes, by the numbers that records have. */
  modes: Array<string>,
  /** The words for why a vehicle stands, by the numbers that records have. */
  standsUnder: Array<string>,
  /** The colours of the first vehicles: red, green, blue. */
  vehicleColours: Array<[number, number, number]>,
  /** The colours of images, from nothing to the most. */
  heat: Array<[number, number, number]>,
  /** The missions that can be begun. */
  missions: Array<DeclaredMission>,
  /** What truly stands in a simulation. */
  truth: Truth | null,
  /** Where the range sensors of simulated vehicles look. */
  sensors: Sensors | null,
  /** Another run that is shown beside this one. */
  ghost: GhostAbout | null,
};

/** A kind of mission. */
export type DeclaredMission = {
  /** The word for it. */
  kind: string,
  /** Its keys. */
  keys: Array<DeclaredKey>,
};

/** What truly stands in the scene of a simulation. */
export type Truth = {
  /** Corners of what stands there at the height of the antennas, and of holes in it. */
  outlines: Array<Array<[number, number]>>,
  /** Who stands there. */
  persons: Array<TruePerson>,
};

/** A person of a simulation. */
export type TruePerson = {
  /** Its name. */
  name: string,
  /** Where it stands. */
  at: [number, number],
  /** Its radius, metres. */
  radius_m: number,
};

/** Where the range sensors of simulated vehicles look, and how far. */
export type Sensors = {
  /** The directions of the beams, radians from where the vehicle faces. */
  beams_rad: Array<number>,
  /** Half of the angle of a beam, radians. */
  half_angle_rad: number,
  /** How far a beam hears, metres. */
  max_range_m: number,
  /** How high the sensors are, metres. */
  height_m: number,
};

/** Another run that is shown beside this one. */
export type GhostAbout = {
  /** Its name. */
  name: string,
  /** Its vehicles. */
  vehicles: Array<number>,
};

/** What was found in the newest image of a subject, and in those before it. */
export type ImageFinds = {
  /** 0: the structure, 1: the change. */
  subject: number,
  /** The run of the newest image. */
  run: number,
  /** Its number. */
  sequence: number,
  /** After how many laps it was made. */
  laps: number,
  /** When it was made, seconds. */
  at_s: number,
  /** How uncertain each pixel was before all measuring, dB/m. */
  priorSd_dbpm: number,
  /** Who was found in it. */
  finds: Array<ToldFind>,
  /** What was found before, oldest first. */
  earlier: Array<EarlierImage>,
};

/** Who was found in an image that is not the newest any more. */
export type EarlierImage = {
  /** When it was made, seconds. */
  at_s: number,
  /** Its run. */
  run: number,
  /** After how many laps it was made. */
  laps: number,
  /** Who was found in it. */
  finds: Array<ToldFind>,
};

/** Somebody who was found. */
export type ToldFind = {
  /** Where. */
  at: [number, number],
  /** The larger of the deviations by x and by y, metres. */
  sd_m: number | null,
  /** The ellipse of one standard deviation. */
  ellipse: Ellipse | null,
  /** How strongly it attenuates, dB/m. */
  strength_dbpm: number,
  /** The probability that it is somebody, 0 to 1. */
  probability: number | null,
};

/** An ellipse of one standard deviation. */
export type Ellipse = {
  /** Half of the longer axis, metres. */
  major_m: number,
  /** Half of the shorter axis, metres. */
  minor_m: number,
  /** How far the longer axis is turned from the x axis, radians. */
  angle_rad: number,
};

/** How a vehicle fares, but for its state, which comes as a record. */
export type ToldVehicle = {
  /** Its number. */
  id: number,
  /** What people call it. */
  name: string | null,
  /** The version of its software. */
  software: string | null,
  /** Why it does not belong to the others. */
  misfit: string | null,
  /** The start of its software. */
  boot: number | null,
  /** The run of the plan that it has accepted. */
  run: number | null,
  /** The revision of that plan. */
  revision: number | null,
  /** What it was ordered last, in words. */
  ordered: string | null,
  /** Who moves it, in words. */
  control: string | null,
  /** How its mission goes. */
  mission: VehicleMission | null,
  /** What it says of itself. */
  health: VehicleHealth | null,
};

/** How the mission of a vehicle goes. */
export type VehicleMission = {
  /** The word for its kind. */
  kind: string,
  /** The word for its phase. */
  phase: string,
  /** How much of it is done, 0 to 1. */
  share: number | null,
  /** How it ended, in words. */
  end: string | null,
  /** Whether the vehicle is at home. */
  isAtHome: boolean,
};

/** What a vehicle says of itself, as far as it is no record. */
export type VehicleHealth = {
  /** How many samples were lost; a number of 64 bits as text. */
  lost: string,
  /** Whom it hears. */
  hears: Array<number>,
  /** What is not as it should be, in words. */
  troubles: Array<string>,
  /** Its autopilot, in words. */
  autopilot: string | null,
};

/** The way that a vehicle is committed to. */
export type Way = {
  /** Its number. */
  id: number,
  /** The corners of the way from where it is on; none while it is committed to none. */
  ahead: Array<[number, number]> | null,
};

/** The plan of a vehicle. */
export type ToldPlan = {
  /** Its number. */
  id: number,
  /** The run of the plan. */
  run: number,
  /** The revision of the plan. */
  revision: number,
  /** Where it begins. */
  start: [number, number],
  /** Its stops, in their order. */
  stops: Array<ToldStop>,
};

/** A stop of a plan. */
export type ToldStop = {
  /** Its number. */
  id: number,
  /** Where. */
  at: [number, number],
  /** The corners of the way there. */
  route: Array<[number, number]>,
  /** Which stops of others it waits for. */
  after: Array<[number, number]>,
};

/** Where a vehicle has been. */
export type ToldTrack = {
  /** Its number. */
  id: number,
  /** x and y in turn, centimetres. */
  places_cm: Array<number>,
};

/** The plans against time. */
export type ToldTimetable = {
  /** The run of the plans; none while there are none. */
  run: number | null,
  /** The revision of the plans. */
  revision: number | null,
  /** How fast vehicles are taken to be, m/s. */
  speed_mps: number,
  /** How long all of it takes, seconds. */
  length_s: number,
  /** The chain of stops that takes longest. */
  chain: Array<[number, number]>,
  /** A row a vehicle. */
  rows: Array<TimetableRow>,
};

/** The plan of a vehicle against time. */
export type TimetableRow = {
  /** Its number. */
  vehicle: number,
  /** The numbers of its stops. */
  stops: Array<number>,
  /** Which stops of others each waits for. */
  after: Array<Array<[number, number]>>,
  /** When each is ready and done, seconds from the beginning. */
  times_s: Array<[number, number]>,
};

/** How far vehicles are in the plans against time. */
export type ToldProgress = {
  /** The run of the plans. */
  run: number | null,
  /** The revision of the plans. */
  revision: number | null,
  /** How far in the time of the plans all are together, seconds. */
  reached_s: number,
  /** A row a vehicle. */
  rows: Array<ProgressRow>,
};

/** How far a vehicle is in its plan. */
export type ProgressRow = {
  /** Its number. */
  vehicle: number,
  /** Whether it follows this plan. */
  isFollowed: boolean,
  /** The last stop that is done. */
  done: number | null,
  /** The stop to which it drives. */
  leg: number | null,
  /** Which stops of others it waits for now. */
  waitsFor: Array<[number, number]>,
};

/** What happened, oldest first. */
export type Events = {
  /** All that are new. */
  events: Array<ToldEvent>,
};

/** What happened. */
export type ToldEvent = {
  /** Counts events. */
  number: number,
  /** How long ago, seconds. */
  age_s: number,
  /** The word for its kind. */
  kind: string,
  /** Whom it concerns. */
  vehicles: Array<number>,
  /** What, in words. */
  text: string,
};

/** Which moment is shown, of which span. */
export type Moment = {
  /** The moment, seconds. */
  at_s: number,
  /** The beginning of what can be shown, seconds. */
  from_s: number,
  /** The end of it, seconds. */
  to_s: number,
  /** How many times as fast as it was; 0 stands still, none is the present. */
  speed: number | null,
  /** Whether all comes anew. */
  isAnew: boolean,
  /** Whether all of that has come. */
  isWhole: boolean,
};

/** What is worth a mark on the line of time, oldest first. */
export type Markers = {
  /** All that are new. */
  markers: Array<Marker>,
};

/** What is worth a mark on the line of time. */
export type Marker = {
  /** When, seconds. */
  at_s: number,
  /** The word for its kind. */
  kind: string,
  /** Whom it concerns. */
  vehicles: Array<number>,
  /** What, in words. */
  text: string,
};

/** How the ground station fares; nothing of it is known while none is heard. */
export type Ground = {
  /** Whether any is heard. */
  isHeard: boolean,
  /** How old this is, seconds. */
  age_s: number,
  /** The number of its lease. */
  lease: number,
  /** The word for what it does. */
  phase: string,
  /** The run. */
  run: number,
  /** How many laps it has. */
  laps: number,
  /** How many of them are done. */
  lapsDone: number,
  /** How many samples are stored; a number of 64 bits as text. */
  samples: string,
  /** How many images were made. */
  images: number,
  /** Whom it expects. */
  expected: Array<number>,
  /** Who takes part. */
  members: Array<number>,
  /** Who was lost. */
  lost: Array<number>,
  /** The word for the order that is in force. */
  inForce: string | null,
  /** The runs that are stored. */
  runs: Array<ToldRun>,
  /** What is not as it should be, in words. */
  troubles: Array<string>,
};

/** A run that is stored. */
export type ToldRun = {
  /** Its number. */
  run: number,
  /** The word for the kind of its mission. */
  kind: string,
  /** The empty run that it is compared with. */
  comparedWith: number | null,
  /** How it ended, in words. */
  end: string,
  /** How many samples it has; a number of 64 bits as text. */
  samples: string,
  /** How many images were made. */
  images: number,
};

/** The open stops, the last orders with how they fared, and who has the seat. */
export type Orders = {
  /** Whether the server is linked to the swarm. */
  isLinked: boolean,
  /** The open stops. */
  stops: Array<OpenStop>,
  /** The last orders, oldest first. */
  orders: Array<ToldOrder>,
  /** Which page may order. */
  seat: number | null,
  /** The number of the lease by which orders are given. */
  lease: number,
};

/** A stop that was not lifted. */
export type OpenStop = {
  /** Its name. */
  name: string,
  /** Whether it stands for several of one moment. */
  isMany: boolean,
  /** Whom it stops; none = all. */
  vehicle: number | null,
  /** The number of whoever said it. */
  by: number,
  /** Who shows it. */
  shown: Array<number>,
  /** Who does not show it, and should. */
  notShown: Array<number>,
};

/** An order of a page. */
export type ToldOrder = {
  /** Counts the orders of the server. */
  number: number,
  /** The word for it. */
  what: string,
  /** The kind of the mission that it begins. */
  mission: string | null,
  /** Of whom; empty = of all. */
  vehicles: Array<number>,
  /** By which page. */
  page: number,
  /** How long ago, seconds. */
  age_s: number,
  /** Whether nothing more comes of it. */
  isOver: boolean,
  /** Whether all do it. */
  isDone: boolean,
  /** Why it was refused, in words. */
  refused: string | null,
  /** What became of it. */
  fates: Array<Fate> | null,
};

/** What became of an order at one vehicle. */
export type Fate = {
  /** Its number. */
  vehicle: number,
  /** Whether it does it. */
  isDone: boolean,
  /** What became of it, in words. */
  words: string,
};

/** Where somebody truly stands, and how the last marks of pages fared. */
export type Marks = {
  /** The marks. */
  marks: Array<KnownMark>,
  /** Those that were given, oldest first. */
  given: Array<ToldMark>,
};

/** Where somebody truly stands. */
export type KnownMark = {
  /** In which run. */
  run: number,
  /** Where. */
  at: [number, number],
  /** The word for whether it is stored. */
  state: string,
};

/** A mark that a page has given. */
export type ToldMark = {
  /** Counts the marks of the server. */
  number: number,
  /** Where. */
  at: [number, number],
  /** In which run. */
  run: number | null,
  /** Whether it is taken back. */
  takeBack: boolean,
  /** By which page. */
  page: number,
  /** How long ago, seconds. */
  age_s: number,
  /** Whether nothing more comes of it. */
  isOver: boolean,
  /** Whether it is stored. */
  isDone: boolean,
  /** What became of it, in words. */
  words: string | null,
};

/** What the range sensors of a vehicle heard of late. */
export type ToldLook = {
  /** Its number. */
  id: number,
  /** Half of the angle of a beam, radians. */
  halfAngle_rad: number,
  /** How far a beam hears, metres. */
  maxRange_m: number,
  /** The oldest first. */
  readings: Array<[number, number, number, number, number | null, number, boolean]>,
};

/** Where the vehicles of another run were. */
export type ToldGhost = {
  /** Its name. */
  name: string,
  /** Of each vehicle. */
  vehicles: Array<GhostWay>,
};

/** Where a vehicle of another run was. */
export type GhostWay = {
  /** Its number. */
  vehicle: number,
  /** The time of the run beside which it is shown (tenths of a second), x, y, z (centimetres) and the heading (hundredths
 * of a radian) in turn. */
  poses: Array<number>,
};

/** The triangles of a simulated scene. */
export type SceneMesh = {
  /** Object by object. */
  objects: Array<ObjectMesh>,
};

/** The triangles of an object. */
export type ObjectMesh = {
  /** Its name. */
  name: string,
  /** Whether its surface is closed. */
  isClosed: boolean,
  /** x, y, z in turn, millimetres. */
  corners_mm: Array<number>,
  /** Three numbers of corners a triangle. */
  triangles: Array<number>,
};

/** Who has seen a cell. */
export type ToldCell = {
  /** The middle of the cell. */
  at: [number, number],
  /** The moment of the answer, seconds. */
  at_s: number,
  /** Who says what, newest first. */
  told: Array<CellWord>,
  /** How many more there are. */
  leftOut: number,
};

/** What somebody says of a cell. */
export type CellWord = {
  /** Who. */
  vehicle: number,
  /** In which start of its software. */
  boot: number,
  /** In which slice of altitude. */
  slice: number,
  /** The word for it. */
  says: string,
  /** The same as the logarithm of the odds that it is occupied. */
  logOdds: number,
  /** How long ago its tile was told, seconds. */
  age_s: number,
  /** Whether it may have been told before that. */
  mayBeOlder: boolean,
};

/** How strongly two vehicles heard each other before a moment: the last strength of each second in which one came, as far as
 * it is kept, oldest first. */
export type ToldPairHistory = {
  /** The moment, seconds. */
  at_s: number,
  /** How the one heard the other. */
  there: Array<ToldStrength>,
  /** How the other heard the one. */
  back: Array<ToldStrength>,
};

/** How strongly somebody was heard. */
export type ToldStrength = {
  /** How long ago this program heard of it, seconds. */
  age_s: number,
  /** The strength. */
  rssi_dbm: number,
};

/** Why a pixel has its value: the links that made it. */
export type Why = {
  /** The run of the image. */
  run: number,
  /** The empty run with which it was compared. */
  emptyRun: number | null,
  /** The middle of the pixel. */
  at: [number, number],
  /** Its value, dB/m. */
  value_dbpm: number,
  /** How many links made it. */
  links: number,
  /** How many links the image itself was made of: more when this program has not heard all. */
  madeOf: number,
  /** How far the nearest of them passes, metres. */
  nearest_m: number | null,
  /** How far links are from what the image says, root of the mean square, dB. */
  residualRms_db: number,
  /** The direction along which the fewest links go through it, degrees from the x axis; none when none goes through it. */
  leastCovered_deg: number | null,
  /** The part of those links that are not told, dB/m. */
  untold_dbpm: number,
  /** The links with the largest parts. */
  told: Array<WhyLink>,
};

/** What a link says of a pixel. */
export type WhyLink = {
  /** One end. */
  from: [number, number],
  /** The other one. */
  to: [number, number],
  /** Its length, metres. */
  length_m: number,
  /** Who drove its ends. */
  vehicles: Array<number>,
  /** Its part of the pixel's value, dB/m. */
  share_dbpm: number,
  /** What is lost on it beyond its distance, dB. */
  loss_db: number,
  /** The deviation of that, dB. */
  sd_db: number,
  /** How far it is from what the image says, dB. */
  residual_db: number,
  /** How many packets were heard. */
  packets: number,
  /** How many were not. */
  misses: number,
};
