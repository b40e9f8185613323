//! A sensor that a test plays behind the lines: each trigger makes the edges that it is told to, at their times.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use super::*;
use crate::hw::echo_edges::Edge;
use crate::node::sensor::{Echo, Ping};

/// Whatever is waited for comes within this time.
const SOON: Duration = Duration::from_secs(20);

/// What the sensor does after each trigger.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Plays {
    /// A pulse so long.
    Pulse(Duration),
    /// Nothing.
    Silence,
    /// It rises for ever, until it loses its supply.
    Stuck,
    /// A spike.
    Spike,
    /// One edge after the other, without end.
    Hum,
}

/// The lines of a sensor that a test plays.
#[derive(Clone)]
pub(super) struct Recorder(Arc<Mutex<Played>>);

struct Played {
    plays: Plays,
    /// Why the lines cannot be opened.
    refused: Option<String>,
    edges: VecDeque<Edge>,
    number: u32,
    is_high: bool,
    triggers: u32,
    power_offs: u32,
}

impl Recorder {
    fn new(plays: Plays) -> Recorder {
        Recorder(Arc::new(Mutex::new(Played {
            plays,
            refused: None,
            edges: VecDeque::new(),
            number: 0,
            is_high: false,
            triggers: 0,
            power_offs: 0,
        })))
    }

    fn with<T>(&self, with: impl FnOnce(&mut Played) -> T) -> T {
        with(&mut self.0.lock().unwrap())
    }

    pub(super) fn open(&self) -> Result<Recorder, String> {
        self.with(|played| played.refused.clone().map_or(Ok(()), Err))?;
        Ok(self.clone())
    }

    pub(super) fn is_high(&self) -> bool {
        self.with(|played| played.is_high)
    }

    pub(super) fn set_trigger(&self, is_high: bool) {
        self.with(|played| {
            if is_high {
                return;
            }
            played.triggers += 1;
            let rise = kernel_now() + Duration::from_micros(450);
            let mut edge = |at, is_rising| {
                played.number += 1;
                let number = played.number;
                played.edges.push_back(Edge {
                    at,
                    is_rising,
                    number,
                });
            };
            match played.plays {
                Plays::Pulse(width) => {
                    edge(rise, true);
                    edge(rise + width, false);
                }
                Plays::Silence | Plays::Hum => {}
                Plays::Stuck => {
                    edge(rise, true);
                    played.is_high = true;
                }
                Plays::Spike => {
                    edge(rise, true);
                    edge(rise + Duration::from_micros(30), false);
                }
            }
        });
    }

    pub(super) fn set_power(&self, is_on: bool) {
        self.with(|played| {
            if is_on {
                return;
            }
            played.power_offs += 1;
            if played.is_high {
                (played.is_high, played.number) = (false, played.number + 1);
                let (number, at) = (played.number, kernel_now());
                played.edges.push_back(Edge {
                    at,
                    is_rising: false,
                    number,
                });
            }
        });
    }

    pub(super) fn next_edge(&self, within: Duration) -> Option<Edge> {
        let until = kernel_now() + within;
        if within > Duration::ZERO && self.with(|played| played.plays == Plays::Hum) {
            return Some(self.with(|played| {
                (played.number, played.is_high) = (played.number + 1, !played.is_high);
                Edge {
                    at: kernel_now(),
                    is_rising: played.is_high,
                    number: played.number,
                }
            }));
        }
        loop {
            let now = kernel_now();
            let is_due = |edge: &Edge| edge.at <= now;
            let edge = self.with(|played| match played.edges.front().is_some_and(is_due) {
                true => played.edges.pop_front(),
                false => None,
            });
            if edge.is_some() || now >= until {
                return edge;
            }
            std::thread::sleep(Duration::from_micros(200));
        }
    }
}

/// The driver under test and what it has told.
struct Driver {
    reader: HcSr04Reader,
    recorder: Recorder,
    clock: Clock,
    pings: SharedPings,
    echoes: Arc<Mutex<Vec<Echo>>>,
    number: u64,
}

impl Driver {
    fn start(recorder: Recorder) -> Driver {
        let echoes = Arc::<Mutex<Vec<Echo>>>::default();
        let heard = echoes.clone();
        let events: EventSink = Arc::new(move |event| match event {
            Event::Echo(echo) => heard.lock().unwrap().push(echo),
            other => panic!("{other:?}"),
        });
        let lines = HcSr04Lines {
            trigger: "GPIO23".to_owned(),
            echo: "GPIO24".to_owned(),
            ..HcSr04Lines::default()
        };
        let (clock, pings) = (Clock::start(), SharedPings::default());
        let wiring = Wiring::Recorded(recorder.clone());
        let reader = HcSr04Reader::on(wiring, &lines, clock, pings.clone(), events).unwrap();
        Driver {
            reader,
            recorder,
            clock,
            pings,
            echoes,
            number: 0,
        }
    }

    fn ping(&mut self) {
        self.number += 1;
        let now = self.clock.now();
        lock(&self.pings.0).ping(
            now,
            Ping {
                number: self.number,
            },
        );
        self.reader.ping(now);
    }

    /// Pings as a vehicle does; returns the answers.
    fn pings(&mut self, count: u64) -> Vec<Option<f64>> {
        for _ in 0..count {
            self.ping();
            std::thread::sleep(Duration::from_millis(100));
        }
        let mut echoes = self.echoes.lock().unwrap();
        echoes.drain(..).map(|echo| echo.range_m).collect()
    }

    fn until(&self, what: &str, is_so: impl Fn(&Driver) -> bool) {
        let began = Instant::now();
        while !is_so(self) {
            assert!(
                began.elapsed() < SOON,
                "{what}: {:?}",
                self.reader.trouble()
            );
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn open(plays: Plays) -> Driver {
        let driver = Driver::start(Recorder::new(plays));
        driver.until("open", |driver| driver.reader.trouble().is_none());
        driver
    }
}

#[test]
fn a_ping_is_answered_by_the_length_of_the_pulse_to_a_millimetre() {
    let mut driver = Driver::open(Plays::Pulse(Duration::from_micros(5824)));
    let answers = driver.pings(5);
    assert!(answers.len() >= 4, "{answers:?}");
    for range_m in answers {
        assert!((range_m.unwrap() - 1.0).abs() <= 0.001);
    }
    driver
        .recorder
        .with(|played| played.plays = Plays::Pulse(Duration::from_millis(38)));
    let answers = driver.pings(3);
    assert!(
        answers.len() >= 2 && answers.iter().all(Option::is_none),
        "{answers:?}"
    );
}

#[test]
fn a_dead_or_disturbed_sensor_gives_no_event_and_is_counted() {
    for (plays, counted) in [
        (
            Plays::Silence,
            (|faults: EchoFaults| faults.silent) as fn(EchoFaults) -> u64,
        ),
        (Plays::Spike, |faults| faults.glitches),
    ] {
        let mut driver = Driver::open(plays);
        assert_eq!(driver.pings(5), [], "{plays:?}");
        let count = counted(driver.reader.faults());
        assert!(count >= 4, "{plays:?}: {:?}", driver.reader.faults());
    }
}

#[test]
fn a_stuck_sensor_gives_no_event_and_loses_its_supply_for_a_moment() {
    let mut driver = Driver::open(Plays::Stuck);
    assert_eq!(driver.pings(6), []);
    assert!(driver.reader.faults().stuck >= 1);
    let (triggers, power_offs) = driver
        .recorder
        .with(|played| (played.triggers, played.power_offs));
    assert_eq!(
        (power_offs, triggers <= 2),
        (1, true),
        "{triggers} triggers: not while the line is high"
    );
    driver.recorder.with(|played| {
        (played.plays, played.is_high) = (Plays::Pulse(Duration::from_micros(5824)), false);
        let (at, number) = (kernel_now(), played.number + 1);
        (played.number, played.edges) = (
            number,
            [Edge {
                at,
                is_rising: false,
                number,
            }]
            .into(),
        );
    });
    let answers = driver.pings(3);
    assert!(answers.iter().any(Option::is_some), "{answers:?}");
}

#[test]
fn lines_that_are_not_there_are_named_and_found_when_they_come() {
    let recorder = Recorder::new(Plays::Silence);
    recorder.with(|played| played.refused = Some("GPIO24: no GPIO line has this name".to_owned()));
    let driver = Driver::start(recorder);
    driver.until("named", |driver| {
        let named = "GPIO23 and GPIO24: GPIO24: no GPIO line has this name";
        driver
            .reader
            .trouble()
            .is_some_and(|trouble| trouble == named)
    });
    driver.recorder.with(|played| played.refused = None);
    driver.until("open", |driver| driver.reader.trouble().is_none());
}

#[test]
fn a_machine_without_such_lines_says_so() {
    let lines = HcSr04Lines {
        trigger: "no such line".to_owned(),
        echo: "nor this one".to_owned(),
        ..HcSr04Lines::default()
    };
    let why = Wiring::of(&lines).open().err().unwrap();
    assert!(why.contains("is needed"), "{why}");
}

#[test]
fn a_recording_says_what_the_line_did_and_what_it_was_taken_for() {
    let lines = HcSr04Lines {
        trigger: "GPIO23".to_owned(),
        echo: "GPIO24".to_owned(),
        ..HcSr04Lines::default()
    };
    for (plays, word, edges) in [
        (Plays::Pulse(Duration::from_micros(5824)), "1.0000", 40),
        (Plays::Pulse(Duration::from_millis(38)), "nothing", 40),
        (Plays::Silence, "silent", 0),
        (Plays::Spike, "glitch", 40),
        (Plays::Stuck, "stuck", 1),
    ] {
        let recorder = Recorder::new(plays);
        let wiring = Wiring::Recorded(recorder.clone());
        let text = recording::record_on(&wiring, &lines).unwrap().to_text();
        let begins = |word: &str| text.lines().filter(|line| line.starts_with(word)).count();
        assert_eq!(
            [begins("trigger "), begins(&format!("expect {word}"))],
            [20, 20],
            "{text}"
        );
        assert_eq!(begins("rise ") + begins("fall "), edges, "{text}");
        assert_eq!(
            recorder.with(|played| played.power_offs),
            0,
            "it only looks"
        );
    }
    let humming = Wiring::Recorded(Recorder::new(Plays::Hum));
    let recorded = recording::record_on(&humming, &lines).unwrap();
    let counts: Vec<usize> = recorded.pings.iter().map(|ping| ping.edges.len()).collect();
    assert_eq!(counts, [200; 20], "it ends");
    let gone = Recorder::new(Plays::Silence);
    gone.with(|played| played.refused = Some("no line is named GPIO23".to_owned()));
    let refused = recording::record_on(&Wiring::Recorded(gone), &lines);
    assert_eq!(refused, Err("no line is named GPIO23".to_owned()));
}
