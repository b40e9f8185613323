//! What the server answers when a page asks for it: triangles of a scene, another run, who has seen a cell, how strongly a pair
//! was heard, why a pixel has its value.

use serde::Serialize;

use super::At;

told! {
    /// Where the vehicles of another run were.
    pub struct ToldGhost {
        /// Its name.
        pub name: String,
        /// Of each vehicle.
        pub vehicles: Vec<GhostWay>,
    }

    /// Where a vehicle of another run was.
    pub struct GhostWay {
        /// Its number.
        pub vehicle: u8,
        /// The time of the run beside which it is shown (tenths of a second), x, y, z (centimetres) and the heading (hundredths
        /// of a radian) in turn.
        pub poses: Vec<i64>,
    }

    /// The triangles of a simulated scene.
    pub struct SceneMesh {
        /// Object by object.
        pub objects: Vec<ObjectMesh>,
    }

    /// The triangles of an object.
    pub struct ObjectMesh {
        /// Its name.
        pub name: String,
        /// Whether its surface is closed.
        #[serde(rename = "isClosed")]
        pub is_closed: bool,
        /// x, y, z in turn, millimetres.
        pub corners_mm: Vec<i64>,
        /// Three numbers of corners a triangle.
        pub triangles: Vec<u32>,
    }

    /// Who has seen a cell.
    pub struct ToldCell {
        /// The middle of the cell.
        pub at: At,
        /// The moment of the answer, seconds.
        pub at_s: f64,
        /// Who says what, newest first.
        pub told: Vec<CellWord>,
        /// How many more there are.
        #[serde(rename = "leftOut")]
        pub left_out: usize,
    }

    /// What somebody says of a cell.
    pub struct CellWord {
        /// Who.
        pub vehicle: u8,
        /// In which start of its software.
        pub boot: u32,
        /// In which slice of altitude.
        pub slice: i16,
        /// The word for it.
        pub says: &'static str,
        /// The same as the logarithm of the odds that it is occupied.
        #[serde(rename = "logOdds")]
        pub log_odds: f64,
        /// How long ago its tile was told, seconds.
        pub age_s: f64,
        /// Whether it may have been told before that.
        #[serde(rename = "mayBeOlder")]
        pub may_be_older: bool,
    }

    /// How strongly two vehicles heard each other before a moment: the last strength of each second in which one came, as far as
    /// it is kept, oldest first.
    pub struct ToldPairHistory {
        /// The moment, seconds.
        pub at_s: f64,
        /// How the one heard the other.
        pub there: Vec<ToldStrength>,
        /// How the other heard the one.
        pub back: Vec<ToldStrength>,
    }

    /// How strongly somebody was heard.
    pub struct ToldStrength {
        /// How long ago this program heard of it, seconds.
        pub age_s: f64,
        /// The strength.
        pub rssi_dbm: i16,
    }

    /// Why a pixel has its value: the links that made it.
    pub struct Why {
        /// The run of the image.
        pub run: u32,
        /// The empty run with which it was compared.
        #[serde(rename = "emptyRun")]
        pub empty_run: Option<u32>,
        /// The middle of the pixel.
        pub at: At,
        /// Its value, dB/m.
        pub value_dbpm: f64,
        /// How many links made it.
        pub links: usize,
        /// How many links the image itself was made of: more when this program has not heard all.
        #[serde(rename = "madeOf")]
        pub made_of: u32,
        /// How far the nearest of them passes, metres.
        pub nearest_m: Option<f64>,
        /// How far links are from what the image says, root of the mean square, dB.
        #[serde(rename = "residualRms_db")]
        pub residual_rms_db: f64,
        /// The direction along which the fewest links go through it, degrees from the x axis; none when none goes through it.
        #[serde(rename = "leastCovered_deg")]
        pub least_covered_deg: Option<f64>,
        /// The part of those links that are not told, dB/m.
        pub untold_dbpm: f64,
        /// The links with the largest parts.
        pub told: Vec<WhyLink>,
    }

    /// What a link says of a pixel.
    pub struct WhyLink {
        /// One end.
        pub from: At,
        /// The other one.
        pub to: At,
        /// Its length, metres.
        pub length_m: f64,
        /// Who drove its ends.
        pub vehicles: Vec<u8>,
        /// Its part of the pixel's value, dB/m.
        pub share_dbpm: f64,
        /// What is lost on it beyond its distance, dB.
        pub loss_db: f64,
        /// The deviation of that, dB.
        pub sd_db: f64,
        /// How far it is from what the image says, dB.
        pub residual_db: f64,
        /// How many packets were heard.
        pub packets: u32,
        /// How many were not.
        pub misses: u32,
    }
}
