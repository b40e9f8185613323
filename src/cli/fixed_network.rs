//! Reads recordings of fixed networks: a file with the place of every node, and files with one line for each round of a
//! receiver: its id, the strength of every node's packet, and the time of day.
//!
//! Pure: text in, measurements out. Every mistake names the line, what was found and what was expected.

use std::collections::BTreeMap;

use super::csv::{nothing_in, numbered};
use super::recording::{FARTHEST_M, RecordingError, STRENGTH_DBM, wrong};
use crate::geom::Point;
use crate::tomo::Link;

/// The header of a file of places.
pub(super) const NODES_HEADER: &str = "id,x_m,y_m";
/// Nodes nearer to each other than this stand at one place, metres.
const APART_M: f64 = 1e-3;
/// Most nodes of a network.
const MOST_NODES: usize = 1000;
/// Seconds of a day.
const DAY_S: f64 = 86_400.0;
/// Lines may be out of order by so much, seconds; what goes back farther was measured by a clock that was set.
const MOST_BACK_S: f64 = 2.0;

/// The places of the nodes: node n of a recording is at index n.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct NodePlaces(pub Vec<Point>);

/// One round of a receiver.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Round {
    /// Since the first round, seconds; rounds of one second of the clock lie evenly within it.
    pub at_s: f64,
    /// Which node has listened.
    pub receiver: usize,
    /// By transmitter, dBm; `None` = the receiver itself.
    pub rssi_dbm: Vec<Option<f64>>,
}

impl NodePlaces {
    /// Reads a file of places.
    ///
    /// # Errors
    /// The first line that is not as expected.
    pub(super) fn read(text: &str) -> Result<NodePlaces, RecordingError> {
        let mut places: BTreeMap<usize, Point> = BTreeMap::new();
        let mut lines = numbered(text);
        let header = lines.next();
        if header.map(|(_, line)| line.replace(' ', "")) != Some(NODES_HEADER.to_owned()) {
            let (line, found) = header.unwrap_or((1, nothing_in(text)));
            return Err(wrong(
                format!("{line}: "),
                found,
                format!("the header {NODES_HEADER}"),
            ));
        }
        for (line, text) in lines {
            let (id, at) = place(line, text)?;
            let mut others = places.iter().filter(|(other, _)| **other != id);
            if let Some((other, _)) = others.find(|(_, place)| place.distance_to(at) < APART_M) {
                let found = format!("node {id} at the place of node {other}");
                return Err(wrong(format!("{line}: "), found, "each place once"));
            }
            if places.insert(id, at).is_some() {
                let found = format!("node {id} a second time");
                return Err(wrong(format!("{line}: "), found, "each node once"));
            }
        }
        let count = places.len();
        if let Some(missing) = (0..count).find(|id| !places.contains_key(id)) {
            let found = format!("no node {missing}, but {count} nodes");
            return Err(wrong(
                String::new(),
                found,
                format!("nodes 0 to {}", count - 1),
            ));
        }
        if count < 2 {
            let found = format!("{count} nodes");
            return Err(wrong(String::new(), found, "at least two nodes"));
        }
        Ok(NodePlaces(places.into_values().collect()))
    }

    /// Reads the rounds of a recording.
    ///
    /// # Errors
    /// The first line that is not as expected.
    pub(super) fn read_rounds(&self, text: &str) -> Result<Vec<Round>, RecordingError> {
        let mut clock = Clock::default();
        let mut rounds = Vec::new();
        for (line, text) in numbered(text) {
            let (receiver, rssi_dbm, second_of_day) = self.round(line, text)?;
            let at_s = clock.count(second_of_day).map_err(|back_s| {
                let found = format!("a time {back_s:.1} s before that of a line above");
                let expected = format!(
                    "times that go on, or back by {MOST_BACK_S} s at most: a clock was set"
                );
                wrong(format!("{line}: "), found, expected)
            })?;
            rounds.push(Round {
                at_s,
                receiver,
                rssi_dbm,
            });
        }
        if rounds.is_empty() {
            return Err(wrong("1: ".into(), nothing_in(text), self.expected_line()));
        }
        spread_within_seconds(&mut rounds);
        Ok(rounds)
    }

    /// Pools rounds to one link for each pair of nodes, both directions together.
    pub(super) fn links(&self, rounds: &[Round]) -> Vec<Link> {
        let mut pooled: BTreeMap<(usize, usize), (u32, f64, f64)> = BTreeMap::new();
        for round in rounds {
            for (transmitter, rssi_dbm) in round.rssi_dbm.iter().enumerate() {
                let Some(rssi_dbm) = rssi_dbm else { continue };
                let pair = (
                    round.receiver.min(transmitter),
                    round.receiver.max(transmitter),
                );
                let (count, sum, squares) = pooled.entry(pair).or_default();
                *count += 1;
                *sum += rssi_dbm;
                *squares += rssi_dbm * rssi_dbm;
            }
        }
        let link = |(pair, (count, sum, squares)): (&(usize, usize), &(u32, f64, f64))| {
            let packets = f64::from(*count);
            let mean_dbm = sum / packets;
            let square = (squares - packets * mean_dbm * mean_dbm) / (packets - 1.0).max(1.0);
            Link {
                spread_db: square.max(0.0).sqrt(),
                ..Link::fixed(self.0[pair.0], self.0[pair.1], *count, mean_dbm)
            }
        };
        pooled.iter().map(link).collect()
    }

    /// Returns the distance between the two nearest nodes, metres.
    pub(super) fn nearest_m(&self) -> f64 {
        let apart = |index: usize| {
            let others = self.0[index + 1..].iter();
            others.map(move |other| other.distance_to(self.0[index]))
        };
        (0..self.0.len())
            .flat_map(apart)
            .fold(f64::INFINITY, f64::min)
    }

    fn expected_line(&self) -> String {
        format!(
            "a receiver, {} strengths, hour, minute, second",
            self.0.len()
        )
    }

    /// Reads one line: the receiver, what it heard, and the second of the day.
    fn round(
        &self,
        line: usize,
        text: &str,
    ) -> Result<(usize, Vec<Option<f64>>, f64), RecordingError> {
        let at = || format!("{line}: ");
        let fields: Vec<&str> = text.split(',').map(str::trim).collect();
        let nodes = self.0.len();
        if fields.len() != nodes + 4 {
            let found = format!("{} values", fields.len());
            return Err(wrong(at(), found, self.expected_line()));
        }
        let receiver = fields[0].parse().ok().filter(|id| *id < nodes);
        let receiver: usize = receiver.ok_or_else(|| {
            let expected = format!("a receiver with a place, 0 to {}", nodes - 1);
            wrong(at(), format!("receiver {}", fields[0]), expected)
        })?;
        let strength = |(transmitter, field): (usize, &&str)| {
            // Its own column holds whatever the recorder put there.
            if transmitter == receiver {
                return Ok(None);
            }
            let value = field.parse::<f64>().ok();
            let is_believed = |dbm: &f64| (STRENGTH_DBM.0..=STRENGTH_DBM.1).contains(dbm);
            let value = value.filter(is_believed).ok_or_else(|| {
                let found = format!("{field} for node {transmitter}");
                let (low, high) = STRENGTH_DBM;
                wrong(at(), found, format!("a strength from {low} to {high} dBm"))
            })?;
            Ok(Some(value))
        };
        let heard = fields[1..=nodes].iter().enumerate().map(strength);
        let clock = |index: usize, most: f64, word: &str| {
            let field = fields[nodes + 1 + index];
            let value = field
                .parse::<f64>()
                .ok()
                .filter(|value| (0.0..most).contains(value));
            value.ok_or_else(|| {
                let expected = format!("{word} from 0 to under {most}");
                wrong(at(), format!("{word} {field}"), expected)
            })
        };
        let rssi_dbm = heard.collect::<Result<_, _>>()?;
        let (hour, minute) = (clock(0, 24.0, "hour")?, clock(1, 60.0, "minute")?);
        let second_of_day = 3600.0 * hour + 60.0 * minute + clock(2, 61.0, "second")?;
        Ok((receiver, rssi_dbm, second_of_day))
    }
}

/// Counts seconds on over midnight.
#[derive(Default)]
struct Clock {
    first: Option<f64>,
    last: f64,
    days: f64,
    /// The latest of all, since the first.
    latest_s: f64,
}

impl Clock {
    /// Returns the seconds since the first call.
    ///
    /// # Errors
    /// By how much it is before the latest one, if that is too much.
    fn count(&mut self, second_of_day: f64) -> Result<f64, f64> {
        let first = *self.first.get_or_insert(second_of_day);
        // Half a day back is a day on, and half a day on a line from before midnight.
        if second_of_day < self.last - DAY_S / 2.0 {
            self.days += 1.0;
        } else if second_of_day > self.last + DAY_S / 2.0 && self.days > 0.0 {
            self.days -= 1.0;
        }
        self.last = second_of_day;
        let since_first_s = second_of_day + self.days * DAY_S - first;
        let back_s = self.latest_s - since_first_s;
        if back_s > MOST_BACK_S {
            return Err(back_s);
        }
        self.latest_s = self.latest_s.max(since_first_s);
        Ok(since_first_s.max(0.0))
    }
}

/// Spreads the rounds of one second of the clock evenly over it.
fn spread_within_seconds(rounds: &mut [Round]) {
    let of_same = |a: &Round, b: &Round| a.at_s == b.at_s;
    for group in rounds.chunk_by_mut(of_same) {
        let count = group.len() as f64;
        for (index, round) in group.iter_mut().enumerate() {
            round.at_s += index as f64 / count;
        }
    }
}

fn place(line: usize, text: &str) -> Result<(usize, Point), RecordingError> {
    let at = || format!("{line}: ");
    let fields: Vec<&str> = text.split(',').map(str::trim).collect();
    let [id, x_m, y_m] = fields[..] else {
        let found = format!("{} values", fields.len());
        return Err(wrong(at(), found, format!("three: {NODES_HEADER}")));
    };
    let number = |field: &str| {
        let value = field
            .parse::<f64>()
            .ok()
            .filter(|value| value.abs() <= FARTHEST_M);
        value.ok_or_else(|| {
            wrong(
                at(),
                field,
                format!("metres from -{FARTHEST_M} to {FARTHEST_M}"),
            )
        })
    };
    let id = id.parse::<usize>().ok().filter(|id| *id < MOST_NODES);
    let id = id.ok_or_else(|| wrong(at(), fields[0], "a node from 0 to 999"))?;
    Ok((id, Point::new(number(x_m)?, number(y_m)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODES: &str = "id,x_m,y_m\n0,0,0\n2,4.0,3.0\n1, 4.0, 0\n";

    fn nodes() -> NodePlaces {
        NodePlaces::read(NODES).unwrap()
    }

    #[test]
    fn rounds_become_links_of_both_directions() {
        let text = "0, -45, -50, -60, 11, 29, 58\n1, -52, -45, -40, 11, 29, 58\n2, -61, -41, -45, 11, 30, 0\n";
        let rounds = nodes().read_rounds(text).unwrap();
        let times: Vec<f64> = rounds.iter().map(|round| round.at_s).collect();
        assert_eq!(times, [0.0, 0.5, 2.0]);
        assert_eq!(rounds[1].rssi_dbm, [Some(-52.0), None, Some(-40.0)]);
        let links = nodes().links(&rounds);
        let means: Vec<(u32, f64)> = links.iter().map(|l| (l.packets, l.mean_dbm)).collect();
        assert_eq!(means, [(2, -51.0), (2, -60.5), (2, -40.5)]);
        assert_eq!(
            (links[1].from, links[1].to),
            (Point::new(0.0, 0.0), Point::new(4.0, 3.0))
        );
        assert!((links[0].spread_db - 2f64.sqrt()).abs() < 1e-9);
        assert_eq!(nodes().nearest_m(), 3.0);
    }

    #[test]
    fn time_goes_on_over_midnight() {
        let line = |h: u32, m: u32, s: u32| format!("0, -45, -50, -60, {h}, {m}, {s}\n");
        let text = line(23, 59, 59) + &line(0, 0, 1);
        let rounds = nodes().read_rounds(&text).unwrap();
        assert_eq!(rounds[1].at_s, 2.0);
    }

    #[test]
    fn what_is_wrong_with_places_is_said_with_its_line() {
        let check = |text: &str, expected: &str| {
            let said = NodePlaces::read(text).unwrap_err().to_string();
            assert!(said.contains(expected), "{said}");
        };
        check("", "1: found an empty file, expected the header id,x_m,y_m");
        check("0,0,0\n", "1: found 0,0,0, expected the header");
        check("id,x_m,y_m\n0,0\n", "2: found 2 values, expected three");
        check(
            "id,x_m,y_m\n0,0,0\n0,1,1\n",
            "3: found node 0 a second time",
        );
        check(
            "id,x_m,y_m\n0,0,0\n1,4,1\n2,4.0000,1\n",
            "4: found node 2 at the place of node 1, expected each place once",
        );
        check(
            "id,x_m,y_m\n0,0,0\n2,1,1\n",
            "found no node 1, but 2 nodes, expected nodes 0 to 1",
        );
        check("id,x_m,y_m\n0,0,nan\n", "2: found nan, expected metres");
        check(
            "id,x_m,y_m\n-1,0,0\n",
            "2: found -1, expected a node from 0 to 999",
        );
        check(
            "id,x_m,y_m\n0,0,0\n",
            "found 1 nodes, expected at least two",
        );
    }

    #[test]
    fn what_is_wrong_with_rounds_is_said_with_its_line() {
        let check = |text: &str, expected: &str| {
            let said = nodes().read_rounds(text).unwrap_err().to_string();
            assert!(said.contains(expected), "{said}");
        };
        check(
            "",
            "1: found an empty file, expected a receiver, 3 strengths",
        );
        check("0, -45, -50, 11, 29, 58\n", "1: found 6 values");
        check(
            "3, -45, -50, -60, 11, 29, 58\n",
            "1: found receiver 3, expected a receiver with a place, 0 to 2",
        );
        check(
            "0, -45, x, -60, 11, 29, 58\n",
            "1: found x for node 1, expected a strength",
        );
        check("0, -45, NaN, -60, 11, 29, 58\n", "1: found NaN for node 1");
        check(
            "0, -45, -50, -60, 24, 29, 58\n",
            "1: found hour 24, expected hour from 0 to under 24",
        );
    }

    #[test]
    fn the_column_of_the_receiver_itself_is_passed_over_whatever_it_holds() {
        for own in ["127", "", "nan", "-45"] {
            let text = format!("0, {own}, -50, -60, 11, 29, 58\n");
            let rounds = nodes().read_rounds(&text).unwrap();
            assert_eq!(
                rounds[0].rssi_dbm,
                [None, Some(-50.0), Some(-60.0)],
                "{own}"
            );
        }
        let text = "0, -45, 127, -60, 11, 29, 58\n";
        let said = nodes().read_rounds(text).unwrap_err().to_string();
        assert!(said.contains("found 127 for node 1"), "{said}");
    }

    #[test]
    fn lines_out_of_order_around_midnight_count_no_day_twice() {
        let times = [(23, 59, 59), (0, 0, 0), (23, 59, 59), (0, 0, 1)];
        let line = |(h, m, s): (u32, u32, u32)| format!("0, -45, -50, -60, {h}, {m}, {s}\n");
        let text: String = times.into_iter().map(line).collect();
        let rounds = nodes().read_rounds(&text).unwrap();
        assert!(rounds.iter().all(|round| round.at_s < 3.0), "{rounds:?}");
    }

    #[test]
    fn a_clock_that_was_set_back_is_refused_with_its_line() {
        let read = |times: &[(u32, u32, u32)]| {
            let line = |(h, m, s): &(u32, u32, u32)| format!("0, -45, -50, -60, {h}, {m}, {s}\n");
            nodes().read_rounds(&times.iter().map(line).collect::<String>())
        };
        let on = read(&[(11, 0, 0), (11, 0, 9), (11, 0, 7), (11, 0, 10)]).unwrap();
        let times: Vec<f64> = on.iter().map(|round| round.at_s).collect();
        assert_eq!(times, [0.0, 9.0, 7.0, 10.0]);
        let said = read(&[(11, 0, 0), (11, 20, 0), (11, 20, 1), (11, 19, 58)]);
        let said = said.unwrap_err().to_string();
        assert!(
            said.starts_with("4: found a time 3.0 s before") && said.contains("a clock was set"),
            "{said}"
        );
        // A step back before the first line crushed all that followed into its moment.
        assert!(read(&[(11, 0, 0), (10, 0, 0), (10, 0, 1)]).is_err());
        assert!(read(&[(23, 59, 59), (0, 0, 1), (23, 59, 50)]).is_err());
    }
}
