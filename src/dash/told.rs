//! What the server tells a page as text (JSON): a type for each text. The types of the page's side, `web/told.d.ts`, are made
//! of these by a test, and the page's modules are checked with them (`tests/types/check.sh`): a name that is changed here and
//! not there is a complaint, no empty cell of a table.
//!
//! Names end in their units, as everywhere; a number of 64 bits goes as text, since a page would round it. Places are x and
//! y in the venue's frame, metres. What is none is `null`.

use serde::Serialize;

/// A place: x and y, metres.
pub type At = [f64; 2];
/// A stop of somebody: the vehicle and the number of the stop.
pub type StopName = (u8, u32);

/// Returns what is told as text.
pub fn as_text(told: &impl Serialize) -> String {
    // Plain structs with names for keys can always be written.
    serde_json::to_string(told).unwrap_or_default()
}

/// Declares types that go to a page: as they are written, and for the page's side in tests.
macro_rules! told {
    ($($(#[$meta:meta])* pub struct $name:ident { $($(#[$field_meta:meta])* pub $field:ident: $kind:ty,)* })*) => {
        $(
            $(#[$meta])*
            #[derive(Clone, PartialEq, Debug, Serialize)]
            #[cfg_attr(test, derive(ts_rs::TS))]
            pub struct $name { $($(#[$field_meta])* pub $field: $kind,)* }
        )*

        /// Returns the page's side of all of these.
        #[cfg(test)]
        pub(in crate::dash::told) fn declarations(config: &ts_rs::Config) -> Vec<String> {
            vec![$($crate::dash::told::declaration::<$name>(config),)*]
        }
    };
}

mod answers;
mod place;

pub use answers::{
    CellWord, GhostWay, ObjectMesh, SceneMesh, ToldCell, ToldGhost, ToldPairHistory, ToldStrength,
    Why, WhyLink,
};
pub use place::{DeclaredMission, GhostAbout, Place, Sensors, Showing, TruePerson, Truth, Welcome};

told! {
    /// What was found in the newest image of a subject, and in those before it.
    pub struct ImageFinds {
        /// 0: the structure, 1: the change.
        pub subject: i64,
        /// The run of the newest image.
        pub run: u32,
        /// Its number.
        pub sequence: u32,
        /// After how many laps it was made.
        pub laps: u32,
        /// When it was made, seconds.
        pub at_s: f64,
        /// How uncertain each pixel was before all measuring, dB/m.
        #[serde(rename = "priorSd_dbpm")]
        pub prior_sd_dbpm: f64,
        /// Who was found in it.
        pub finds: Vec<ToldFind>,
        /// What was found before, oldest first.
        pub earlier: Vec<EarlierImage>,
    }

    /// Who was found in an image that is not the newest any more.
    pub struct EarlierImage {
        /// When it was made, seconds.
        pub at_s: f64,
        /// Its run.
        pub run: u32,
        /// After how many laps it was made.
        pub laps: u32,
        /// Who was found in it.
        pub finds: Vec<ToldFind>,
    }

    /// Somebody who was found.
    pub struct ToldFind {
        /// Where.
        pub at: At,
        /// The larger of the deviations by x and by y, metres.
        pub sd_m: Option<f64>,
        /// The ellipse of one standard deviation.
        pub ellipse: Option<Ellipse>,
        /// How strongly it attenuates, dB/m.
        pub strength_dbpm: f64,
        /// The probability that it is somebody, 0 to 1.
        pub probability: Option<f64>,
    }

    /// An ellipse of one standard deviation.
    pub struct Ellipse {
        /// Half of the longer axis, metres.
        pub major_m: f64,
        /// Half of the shorter axis, metres.
        pub minor_m: f64,
        /// How far the longer axis is turned from the x axis, radians.
        pub angle_rad: f64,
    }

    /// How a vehicle fares, but for its state, which comes as a record.
    pub struct ToldVehicle {
        /// Its number.
        pub id: u8,
        /// What people call it.
        pub name: Option<String>,
        /// The version of its software.
        pub software: Option<String>,
        /// Why it does not belong to the others.
        pub misfit: Option<String>,
        /// The start of its software.
        pub boot: Option<u32>,
        /// The run of the plan that it has accepted.
        pub run: Option<u32>,
        /// The revision of that plan.
        pub revision: Option<u32>,
        /// What it was ordered last, in words.
        pub ordered: Option<String>,
        /// Who moves it, in words.
        pub control: Option<&'static str>,
        /// How its mission goes.
        pub mission: Option<VehicleMission>,
        /// What it says of itself.
        pub health: Option<VehicleHealth>,
    }

    /// How the mission of a vehicle goes.
    pub struct VehicleMission {
        /// The word for its kind.
        pub kind: &'static str,
        /// The word for its phase.
        pub phase: &'static str,
        /// How much of it is done, 0 to 1.
        pub share: Option<f64>,
        /// How it ended, in words.
        pub end: Option<String>,
        /// Whether the vehicle is at home.
        #[serde(rename = "isAtHome")]
        pub is_at_home: bool,
    }

    /// What a vehicle says of itself, as far as it is no record.
    pub struct VehicleHealth {
        /// How many samples were lost; a number of 64 bits as text.
        pub lost: String,
        /// Whom it hears.
        pub hears: Vec<u8>,
        /// What is not as it should be, in words.
        pub troubles: Vec<String>,
        /// Its autopilot, in words.
        pub autopilot: Option<String>,
    }

    /// The way that a vehicle is committed to.
    pub struct Way {
        /// Its number.
        pub id: u8,
        /// The corners of the way from where it is on; none while it is committed to none.
        pub ahead: Option<Vec<At>>,
    }

    /// The plan of a vehicle.
    pub struct ToldPlan {
        /// Its number.
        pub id: u8,
        /// The run of the plan.
        pub run: u32,
        /// The revision of the plan.
        pub revision: u32,
        /// Where it begins.
        pub start: At,
        /// Its stops, in their order.
        pub stops: Vec<ToldStop>,
    }

    /// A stop of a plan.
    pub struct ToldStop {
        /// Its number.
        pub id: u32,
        /// Where.
        pub at: At,
        /// The corners of the way there.
        pub route: Vec<At>,
        /// Which stops of others it waits for.
        pub after: Vec<StopName>,
    }

    /// Where a vehicle has been.
    pub struct ToldTrack {
        /// Its number.
        pub id: u8,
        /// x and y in turn, centimetres.
        pub places_cm: Vec<i32>,
    }

    /// The plans against time.
    pub struct ToldTimetable {
        /// The run of the plans; none while there are none.
        pub run: Option<u32>,
        /// The revision of the plans.
        pub revision: Option<u32>,
        /// How fast vehicles are taken to be, m/s.
        pub speed_mps: f64,
        /// How long all of it takes, seconds.
        pub length_s: f64,
        /// The chain of stops that takes longest.
        pub chain: Vec<StopName>,
        /// A row a vehicle.
        pub rows: Vec<TimetableRow>,
    }

    /// The plan of a vehicle against time.
    pub struct TimetableRow {
        /// Its number.
        pub vehicle: u8,
        /// The numbers of its stops.
        pub stops: Vec<u32>,
        /// Which stops of others each waits for.
        pub after: Vec<Vec<StopName>>,
        /// When each is ready and done, seconds from the beginning.
        pub times_s: Vec<[f64; 2]>,
    }

    /// How far vehicles are in the plans against time.
    pub struct ToldProgress {
        /// The run of the plans.
        pub run: Option<u32>,
        /// The revision of the plans.
        pub revision: Option<u32>,
        /// How far in the time of the plans all are together, seconds.
        pub reached_s: f64,
        /// A row a vehicle.
        pub rows: Vec<ProgressRow>,
    }

    /// How far a vehicle is in its plan.
    pub struct ProgressRow {
        /// Its number.
        pub vehicle: u8,
        /// Whether it follows this plan.
        #[serde(rename = "isFollowed")]
        pub is_followed: bool,
        /// The last stop that is done.
        pub done: Option<u32>,
        /// The stop to which it drives.
        pub leg: Option<u32>,
        /// Which stops of others it waits for now.
        #[serde(rename = "waitsFor")]
        pub waits_for: Vec<StopName>,
    }

    /// What happened, oldest first.
    pub struct Events {
        /// All that are new.
        pub events: Vec<ToldEvent>,
    }

    /// What happened.
    pub struct ToldEvent {
        /// Counts events.
        pub number: u64,
        /// How long ago, seconds.
        pub age_s: f64,
        /// The word for its kind.
        pub kind: &'static str,
        /// Whom it concerns.
        pub vehicles: Vec<u8>,
        /// What, in words.
        pub text: String,
    }

    /// Which moment is shown, of which span.
    pub struct Moment {
        /// The moment, seconds.
        pub at_s: f64,
        /// The beginning of what can be shown, seconds.
        pub from_s: f64,
        /// The end of it, seconds.
        pub to_s: f64,
        /// How many times as fast as it was; 0 stands still, none is the present.
        pub speed: Option<f64>,
        /// Whether all comes anew.
        #[serde(rename = "isAnew")]
        pub is_anew: bool,
        /// Whether all of that has come.
        #[serde(rename = "isWhole")]
        pub is_whole: bool,
    }

    /// What is worth a mark on the line of time, oldest first.
    pub struct Markers {
        /// All that are new.
        pub markers: Vec<Marker>,
    }

    /// What is worth a mark on the line of time.
    pub struct Marker {
        /// When, seconds.
        pub at_s: f64,
        /// The word for its kind.
        pub kind: &'static str,
        /// Whom it concerns.
        pub vehicles: Vec<u8>,
        /// What, in words.
        pub text: String,
    }

    /// How the ground station fares; nothing of it is known while none is heard.
    #[derive(Default)]
    pub struct Ground {
        /// Whether any is heard.
        #[serde(rename = "isHeard")]
        pub is_heard: bool,
        /// How old this is, seconds.
        pub age_s: f64,
        /// The number of its lease.
        pub lease: u32,
        /// The word for what it does.
        pub phase: &'static str,
        /// The run.
        pub run: u32,
        /// How many laps it has.
        pub laps: u32,
        /// How many of them are done.
        #[serde(rename = "lapsDone")]
        pub laps_done: u32,
        /// How many samples are stored; a number of 64 bits as text.
        pub samples: String,
        /// How many images were made.
        pub images: u32,
        /// Whom it expects.
        pub expected: Vec<u8>,
        /// Who takes part.
        pub members: Vec<u8>,
        /// Who was lost.
        pub lost: Vec<u8>,
        /// The word for the order that is in force.
        #[serde(rename = "inForce")]
        pub in_force: Option<&'static str>,
        /// The runs that are stored.
        pub runs: Vec<ToldRun>,
        /// What is not as it should be, in words.
        pub troubles: Vec<String>,
    }

    /// A run that is stored.
    pub struct ToldRun {
        /// Its number.
        pub run: u32,
        /// The word for the kind of its mission.
        pub kind: &'static str,
        /// The empty run that it is compared with.
        #[serde(rename = "comparedWith")]
        pub compared_with: Option<u32>,
        /// How it ended, in words.
        pub end: &'static str,
        /// How many samples it has; a number of 64 bits as text.
        pub samples: String,
        /// How many images were made.
        pub images: u32,
    }

    /// The open stops, the last orders with how they fared, and who has the seat.
    pub struct Orders {
        /// Whether the server is linked to the swarm.
        #[serde(rename = "isLinked")]
        pub is_linked: bool,
        /// The open stops.
        pub stops: Vec<OpenStop>,
        /// The last orders, oldest first.
        pub orders: Vec<ToldOrder>,
        /// Which page may order.
        pub seat: Option<u32>,
        /// The number of the lease by which orders are given.
        pub lease: u32,
    }

    /// A stop that was not lifted.
    pub struct OpenStop {
        /// Its name.
        pub name: String,
        /// Whether it stands for several of one moment.
        #[serde(rename = "isMany")]
        pub is_many: bool,
        /// Whom it stops; none = all.
        pub vehicle: Option<u8>,
        /// The number of whoever said it.
        pub by: u8,
        /// Who shows it.
        pub shown: Vec<u8>,
        /// Who does not show it, and should.
        #[serde(rename = "notShown")]
        pub not_shown: Vec<u8>,
    }

    /// An order of a page.
    pub struct ToldOrder {
        /// Counts the orders of the server.
        pub number: u32,
        /// The word for it.
        pub what: &'static str,
        /// The kind of the mission that it begins.
        pub mission: Option<String>,
        /// Of whom; empty = of all.
        pub vehicles: Vec<u8>,
        /// By which page.
        pub page: u32,
        /// How long ago, seconds.
        pub age_s: f64,
        /// Whether nothing more comes of it.
        #[serde(rename = "isOver")]
        pub is_over: bool,
        /// Whether all do it.
        #[serde(rename = "isDone")]
        pub is_done: bool,
        /// Why it was refused, in words.
        pub refused: Option<String>,
        /// What became of it.
        pub fates: Option<Vec<Fate>>,
    }

    /// What became of an order at one vehicle.
    pub struct Fate {
        /// Its number.
        pub vehicle: u8,
        /// Whether it does it.
        #[serde(rename = "isDone")]
        pub is_done: bool,
        /// What became of it, in words.
        pub words: String,
    }

    /// Where somebody truly stands, and how the last marks of pages fared.
    pub struct Marks {
        /// The marks.
        pub marks: Vec<KnownMark>,
        /// Those that were given, oldest first.
        pub given: Vec<ToldMark>,
    }

    /// Where somebody truly stands.
    pub struct KnownMark {
        /// In which run.
        pub run: u32,
        /// Where.
        pub at: At,
        /// The word for whether it is stored.
        pub state: &'static str,
    }

    /// A mark that a page has given.
    pub struct ToldMark {
        /// Counts the marks of the server.
        pub number: u32,
        /// Where.
        pub at: At,
        /// In which run.
        pub run: Option<u32>,
        /// Whether it is taken back.
        #[serde(rename = "takeBack")]
        pub take_back: bool,
        /// By which page.
        pub page: u32,
        /// How long ago, seconds.
        pub age_s: f64,
        /// Whether nothing more comes of it.
        #[serde(rename = "isOver")]
        pub is_over: bool,
        /// Whether it is stored.
        #[serde(rename = "isDone")]
        pub is_done: bool,
        /// What became of it, in words.
        pub words: Option<String>,
    }

    /// What the range sensors of a vehicle heard of late.
    pub struct ToldLook {
        /// Its number.
        pub id: u8,
        /// Half of the angle of a beam, radians.
        #[serde(rename = "halfAngle_rad")]
        pub half_angle_rad: f64,
        /// How far a beam hears, metres.
        #[serde(rename = "maxRange_m")]
        pub max_range_m: f64,
        /// The oldest first.
        pub readings: Vec<ToldReading>,
    }
}

/// A reading of a range sensor: x, y and z of the sensor, metres; its direction, radians; the range, metres, or none; its age,
/// seconds; and whether it is suspect.
pub type ToldReading = (f64, f64, f64, f64, Option<f64>, f64, bool);

/// Returns the page's side of a type, with what is said of it.
#[cfg(test)]
fn declaration<T: ts_rs::TS>(config: &ts_rs::Config) -> String {
    let docs = T::docs().unwrap_or_default();
    let lines = format!("{docs}export {}\n", T::decl(config));
    let lines = lines.replace("/**\n * ", "/** ").replace("\n */", " */");
    // Each field stands with its docs, indented.
    lines
        .replace(" \n/** ", "\n  /** ")
        .replace(" */\n", " */\n  ")
        .replace("  export ", "export ")
        .replace(", };", ",\n};")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_the_same_types() {
        let config = ts_rs::Config::new().with_large_int("number");
        let mut all = vec![
            declaration::<Showing>(&config),
            declaration::<crate::config::DeclaredKey>(&config),
        ];
        all.extend(place::declarations(&config));
        all.extend(declarations(&config));
        all.extend(answers::declarations(&config));
        let head = "// What the server tells a page as text. Made of src/dash/told.rs by its test; not to be edited.\n\n";
        let source = head.to_owned() + &all.join("\n");
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/web/told.d.ts");
        if std::fs::read_to_string(path).unwrap_or_default() != source {
            std::fs::write(path, source).unwrap();
            panic!("web/told.d.ts did not say what the types say, and was written anew");
        }
    }
}
