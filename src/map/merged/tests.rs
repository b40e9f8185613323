//! The merged map: what joining tiles does, whatever their order, and how maps repair each other.

use super::*;
use crate::geom::Point;
use proptest::prelude::*;
use std::sync::Arc;
use tomoswarm_proto::{Boot, VehicleId};

fn layer(vehicle: u8, boot: u32) -> LayerId {
    LayerId {
        vehicle: VehicleId(vehicle),
        boot: Boot(boot),
    }
}

fn listener() -> Merged {
    Merged::new(Lattice::new(0.2), None)
}

/// A report of few layers, places and revisions, so that they meet; cells all of one value, so that also
/// two different tiles of one revision meet.
fn any_report() -> impl Strategy<Value = TileReport> {
    (0..3u8, 0..2u32, -1..1i32, 0..3u32, any::<i8>()).prop_map(
        |(vehicle, boot, x, revision, value)| TileReport {
            layer: layer(vehicle, boot),
            address: TileAddress { slice: 0, x, y: 0 },
            revision,
            cells: Arc::new([value; TILE_CELLS]),
        },
    )
}

fn joined<'a>(reports: impl Iterator<Item = &'a TileReport>) -> Merged {
    joined_to(listener(), reports)
}

fn joined_to<'a>(mut map: Merged, reports: impl Iterator<Item = &'a TileReport>) -> Merged {
    for report in reports {
        map.join(report).unwrap();
    }
    map
}

proptest! {
    #[test]
    fn order_and_repetition_of_reports_do_not_matter(
        reports in proptest::collection::vec(any_report(), 1..20), order in any::<prop::sample::Index>(),
    ) {
        let straight = joined(reports.iter());
        let turn = order.index(reports.len());
        let shuffled = reports[turn..].iter().rev().chain(&reports[..turn]).chain(&reports[turn..]);
        prop_assert_eq!(&straight, &joined(shuffled.clone()));
        let trusting = || Merged::trusting(Lattice::new(0.2), layer(0, 1));
        let straight = joined_to(trusting(), reports.iter());
        prop_assert_eq!(&straight, &joined_to(trusting(), shuffled));
    }

    #[test]
    fn taking_all_of_another_map_is_joining_its_reports(
        ours in proptest::collection::vec(any_report(), 0..20), theirs in proptest::collection::vec(any_report(), 0..20),
    ) {
        let (mut one, mut other) = (joined(ours.iter()), joined(theirs.iter()));
        let all = joined(ours.iter().chain(&theirs));
        other.join_all(&one);
        one.join_all(&joined(theirs.iter()));
        prop_assert_eq!(&one, &all);
        prop_assert_eq!(&other, &all);
    }

    #[test]
    fn the_merged_cell_is_the_clamped_sum_of_the_newest_but_silence_from_afar_counts_once_and_frees_nothing_confirmed(reports in proptest::collection::vec(any_report(), 1..20)) {
        let map = joined(reports.iter());
        for x in -1..1i32 {
            let layers = (0..3).flat_map(|vehicle| (0..2).map(move |boot| layer(vehicle, boot)));
            let newest = layers.filter_map(|id| {
                let of_layer = reports.iter().filter(|r| r.layer == id && r.address.x == x);
                of_layer.map(|r| (r.revision, r.cells[5].clamp(-17, 17))).max()
            });
            let values: Vec<i8> = newest.map(|(_, value)| value).collect();
            let (afar, others): (Vec<i8>, Vec<i8>) = values.iter().partition(|value| (-16..0).contains(*value));
            let sum = |values: &[i8]| values.iter().map(|value| i16::from(*value)).sum::<i16>();
            let sum = sum(&others) + afar.iter().min().map_or(0, |value| i16::from(*value));
            let is_held = values.iter().any(|value| *value >= 13) && !values.contains(&-17);
            let expected = if is_held { sum.max(9) } else { sum };
            prop_assert_eq!(map.value(0, Cell::new(x * 32 + 5, 0)), expected.clamp(-100, 100));
        }
    }

    #[test]
    fn nodes_agree_once_the_bus_is_quiet(
        writes in proptest::collection::vec((0..3usize, -2..2i32, 0..TILE_CELLS, -17..=17i8, any::<bool>()), 1..60),
    ) {
        let mut nodes = [0, 1, 2].map(|node| Merged::new(Lattice::new(0.2), Some(layer(node, 1))));
        for (node, x, index, value, lost) in writes {
            let (own, address) = (layer(node as u8, 1), TileAddress { slice: 0, x, y: 0 });
            nodes[node].write(own, address, &[(index, value)]);
            let report = nodes[node].report(own, address).unwrap();
            if !lost {
                nodes[(node + 1) % 3].join(&report).unwrap();
            }
        }
        let rounds = repair(&mut nodes);
        prop_assert!(rounds < 20);
        prop_assert_eq!(nodes[0].digest(), nodes[1].digest());
        prop_assert_eq!(&nodes[0].layers, &nodes[1].layers);
        prop_assert_eq!(&nodes[2].layers, &nodes[1].layers);
        // What these say together is the same to all that trust the same layer.
        let told = nodes.map(|node| {
            let reports: Vec<TileReport> = node
                .layers()
                .flat_map(|(id, layer)| layer.tiles().map(move |(address, tile)| tile.report(id, address)))
                .collect();
            joined(reports.iter())
        });
        prop_assert_eq!(&told[0].joined, &told[1].joined);
        prop_assert_eq!(&told[2].joined, &told[1].joined);
    }
}

/// Exchanges digests, wants and answers (two tiles at a time) until nobody sends a tile; returns the rounds.
fn repair(nodes: &mut [Merged]) -> usize {
    for round in 0..100 {
        let mut sent = 0;
        for (hearer, speaker) in (0..3)
            .flat_map(|a| (0..3).map(move |b| (a, b)))
            .filter(|(a, b)| a != b)
        {
            let digest = nodes[speaker].digest();
            for theirs in &digest.layers {
                if !nodes[hearer].lacks(theirs) {
                    continue;
                }
                let (want, _) = nodes[hearer].want(theirs.layer, None);
                for address in nodes[speaker].newer(&want).into_iter().take(2) {
                    let report = nodes[speaker].report(theirs.layer, address).unwrap();
                    nodes[hearer].join(&report).unwrap();
                    sent += 1;
                }
            }
        }
        if sent == 0 {
            return round;
        }
    }
    100
}

#[test]
fn who_holds_fewer_revisions_lacks_something_and_who_holds_other_ones_too() {
    let tile = |x, revision| {
        let address = TileAddress { slice: 0, x, y: 0 };
        TileReport {
            layer: layer(1, 1),
            address,
            revision,
            cells: Arc::new([9; TILE_CELLS]),
        }
    };
    let digest = |map: &Merged| map.digest().layers[0];
    let (all, one) = (
        joined([tile(0, 2), tile(1, 1)].iter()),
        joined([tile(0, 2)].iter()),
    );
    assert!(one.lacks(&digest(&all)) && !all.lacks(&digest(&one)) && !all.lacks(&digest(&all)));
    let other = joined([tile(1, 2)].iter());
    assert!(one.lacks(&digest(&other)) && other.lacks(&digest(&one)));
    assert!(listener().lacks(&digest(&one)));
    let mut writer = Merged::new(Lattice::new(0.2), Some(layer(1, 1)));
    assert!(
        writer.lacks(&digest(&one)),
        "what it has not written it asks for, to disown it"
    );
    (0..2).for_each(|_| assert!(!writer.write(layer(1, 1), TileAddress::default(), &[])));
    assert!(
        !writer.lacks(&digest(&one)),
        "nobody but the writer is ahead of it"
    );
    let (fresh, none) = (
        joined([tile(0, 2), tile(3, 0)].iter()),
        joined([tile(0, 2)].iter()),
    );
    assert!(
        none.lacks(&digest(&fresh)) && !fresh.lacks(&digest(&none)),
        "a tile of revision 0 counts"
    );
}

#[test]
fn nobody_else_writes_the_own_layer_and_a_full_map_takes_no_more() {
    let mut map = Merged::new(Lattice::new(0.2), Some(layer(1, 4)));
    let mut report = TileReport {
        layer: layer(1, 4),
        address: TileAddress::default(),
        revision: 1,
        cells: Arc::new([17; TILE_CELLS]),
    };
    assert_eq!(map.join(&report), Err(TileRefusal::Own));
    for boot in 0..MAX_LAYERS as u32 {
        report.layer = layer(2, boot);
        assert!(map.join(&report).is_ok());
    }
    report.layer = layer(3, 0);
    assert_eq!(map.join(&report), Err(TileRefusal::Full));
    assert_eq!(map.value(0, Cell::new(0, 0)), MERGED_CLAMP);
}

#[test]
fn what_others_say_of_the_own_layer_is_disowned_and_everybody_holds_the_own_tile_again() {
    let own = layer(1, 4);
    let mut writer = Merged::new(Lattice::new(0.2), Some(own));
    writer.write(own, TileAddress::default(), &[(7, -9)]);
    let elsewhere = TileAddress {
        x: 3,
        ..TileAddress::default()
    };
    for (address, revision) in [
        (TileAddress::default(), 1),
        (TileAddress::default(), 900),
        (elsewhere, ANY_REVISION_UNTIL),
    ] {
        let mut other = listener();
        writer
            .report(own, address)
            .inspect(|report| assert!(other.join(report).is_ok()));
        let forged = TileReport {
            layer: own,
            address,
            revision,
            cells: Arc::new([17; TILE_CELLS]),
        };
        other.join(&forged).unwrap();
        assert!(writer.lacks(&digest_of(&other, own)) || revision == 1);
        assert!(writer.disown(&forged), "{revision}");
        let put_right = writer.report(own, address).unwrap();
        assert!(!writer.disown(&put_right), "its own word comes back to it");
        assert!(matches!(
            other.join(&put_right),
            Ok(JoinResult::Newer { .. })
        ));
        assert_eq!(
            other.layer(own).unwrap().tile(address),
            writer.layer(own).unwrap().tile(address)
        );
    }
    assert_eq!(
        writer.value(0, Cell::new(7, 0)),
        -9,
        "and the writer's map is what it was"
    );
}

fn digest_of(map: &Merged, id: LayerId) -> LayerDigest {
    map.layer(id).unwrap().digest(id)
}

#[test]
fn a_revision_that_leaps_is_refused() {
    let mut map = listener();
    let mut report = TileReport {
        layer: layer(1, 1),
        address: TileAddress::default(),
        revision: u32::MAX,
        cells: Arc::new([17; TILE_CELLS]),
    };
    assert_eq!(
        map.join(&report),
        Err(TileRefusal::Leaps {
            revision: u32::MAX,
            held: 0
        })
    );
    for step in [ANY_REVISION_UNTIL, ANY_REVISION_UNTIL + REVISION_STEP] {
        report.revision = step;
        assert!(map.join(&report).is_ok());
    }
    report.revision += REVISION_STEP + 1;
    assert!(matches!(map.join(&report), Err(TileRefusal::Leaps { .. })));
}

#[test]
fn an_earlier_boot_of_the_own_vehicle_stays_readable() {
    let mut before = Merged::new(Lattice::new(0.2), Some(layer(1, 4)));
    before.write(layer(1, 4), TileAddress::default(), &[(7, 9)]);
    let mut map = Merged::new(Lattice::new(0.2), Some(layer(1, 5)));
    let report = before.report(layer(1, 4), TileAddress::default()).unwrap();
    assert_eq!(
        map.join(&report),
        Ok(JoinResult::Newer {
            newly_occupied: true
        })
    );
    assert_eq!(map.join(&report), Ok(JoinResult::Known));
    assert_eq!(map.occupancy(0, Cell::new(7, 0)), Occupancy::Occupied);
    assert_eq!(map.occupancy(1, Cell::new(7, 0)), Occupancy::Unknown);
}

#[test]
fn the_weight_of_one_vehicle_is_less_than_one_fresh_hit_by_two() {
    let mut map = listener();
    let mut report = TileReport {
        layer: layer(1, 1),
        address: TileAddress::default(),
        revision: 1,
        cells: Arc::new([-128; TILE_CELLS]),
    };
    map.join(&report).unwrap();
    assert_eq!(map.occupancy(0, Cell::new(0, 0)), Occupancy::Free);
    for vehicle in 2..4 {
        (report.layer, report.cells) = (layer(vehicle, 1), Arc::new([9; TILE_CELLS]));
        map.join(&report).unwrap();
    }
    assert!(map.value(0, Cell::new(0, 0)) > 0);
    assert_ne!(map.occupancy(0, Cell::new(0, 0)), Occupancy::Free);
}

#[test]
fn a_view_reads_as_the_map_does() {
    let mut map = listener();
    for (x, y, value) in [(-1, 0, 17), (0, 0, -9), (1, -1, 3)] {
        let (address, cells) = (
            TileAddress { slice: 0, x, y },
            Arc::new([value; TILE_CELLS]),
        );
        map.join(&TileReport {
            layer: layer(1, 1),
            address,
            revision: 1,
            cells,
        })
        .unwrap();
    }
    let rect = CellRect::around(
        map.lattice(),
        &[Point::new(-2.0, -2.0), Point::new(3.0, 3.0)],
        0.0,
    )
    .unwrap();
    let view = map.view(0, rect);
    for cell in (-80..80).flat_map(|x| (-80..80).map(move |y| Cell::new(x, y))) {
        let inside = (-32..32).contains(&cell.x) && (-32..32).contains(&cell.y);
        let expected = if inside {
            map.occupancy(0, cell)
        } else {
            Occupancy::Unknown
        };
        assert_eq!(view.occupancy(cell), expected, "{cell:?}");
    }
    assert_eq!(
        view.occupancy(Cell::new(i32::MIN, i32::MAX)),
        Occupancy::Unknown
    );
    assert_eq!(
        map.extent(0),
        Some(CellRect::new(Cell::new(-32, -32), Cell::new(63, 31)))
    );
    assert_eq!(map.extent(3), None);
}

#[test]
fn of_a_layer_of_many_tiles_just_what_is_lacking_is_sent_wherever_it_lies() {
    let layer = layer(1, 1);
    let cells = Arc::new([9; TILE_CELLS]);
    let tile = |index: i32| TileReport {
        layer,
        address: TileAddress {
            slice: 0,
            x: index % 100,
            y: index / 100,
        },
        revision: 1,
        cells: Arc::clone(&cells),
    };
    let (count, lost) = (9000, [0, 1, 4000, 4095, 4096, 4500, 8191, 8998, 8999]);
    let (mut whole, mut torn) = (listener(), listener());
    for index in 0..count {
        whole.join(&tile(index)).unwrap();
        if !lost.contains(&index) {
            torn.join(&tile(index)).unwrap();
        }
    }
    let (mut from, mut sent) = (None, 0);
    for _ in 0..4 {
        let (want, next) = torn.want(layer, from);
        for address in whole.newer(&want) {
            torn.join(&whole.report(layer, address).unwrap()).unwrap();
            sent += 1;
        }
        from = next;
    }
    assert_eq!(sent, lost.len(), "nothing is sent twice");
    let digest = whole.layer(layer).unwrap().digest(layer);
    assert!(!torn.lacks(&digest));
}
