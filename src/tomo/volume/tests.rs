//! Volumes of phantoms, by all solvers.

use super::*;
use crate::geom::Rect;
use crate::tomo::ImagingSettings;
use crate::tomo::tests_support::Noise;

const GRID: VoxelGrid = VoxelGrid {
    low_m: [0.0; 3],
    high_m: [10.0, 10.0, 6.0],
    counts: [20, 20, 6],
};
/// Finer than the volume, so that no voxel of it is wholly of one kind.
const FINE: VoxelGrid = VoxelGrid {
    counts: [70, 70, 42],
    ..GRID
};

fn solvers() -> [(&'static str, Solver); 6] {
    let area = Rect::new(Point::new(0.0, 0.0), Point::new(10.0, 10.0));
    [
        ("map", ImagingSettings::for_change(area).solver),
        ("tikhonov", ImagingSettings::tikhonov_for(area)),
        ("tsvd", Solver::TSVD),
        ("nn", Solver::NonNegative(ImagingSettings::sparse_for(area))),
        (
            "tv",
            Solver::Variation(ImagingSettings::candidates_for(area)),
        ),
        ("auto", Solver::Auto(ImagingSettings::candidates_for(area))),
    ]
}

fn map() -> Solver {
    solvers()[0].1
}

fn is_in(at: [f64; 3], low: [f64; 3], high: [f64; 3]) -> bool {
    (0..3).all(|axis| at[axis] >= low[axis] && at[axis] < high[axis])
}

/// A wall with a corner, 2.4 m high; 4 dB/m.
fn wall(at: [f64; 3]) -> f64 {
    let one = is_in(at, [2.1, 2.3, 0.0], [2.8, 7.6, 2.4]);
    let other = is_in(at, [2.1, 2.3, 0.0], [6.4, 3.0, 2.4]);
    if one || other { 4.0 } else { 0.0 }
}

/// Two persons, one of them on something; 8 dB/m.
fn persons(at: [f64; 3]) -> f64 {
    let one = is_in(at, [3.2, 3.4, 0.0], [3.7, 3.9, 1.8]);
    let other = is_in(at, [6.9, 6.1, 3.0], [7.4, 6.6, 4.8]);
    if one || other { 8.0 } else { 0.0 }
}

/// A phantom: one box low in the west, one high in the east; 6 dB/m.
fn truth(at: [f64; 3]) -> f64 {
    let low = is_in(at, [2.0, 4.0, 0.0], [3.5, 6.0, 2.0]);
    let high = is_in(at, [6.5, 5.0, 4.0], [8.0, 6.5, 6.0]);
    if low || high { 6.0 } else { 0.0 }
}

/// Links between copters at three heights around the box.
fn links(truth: impl Fn([f64; 3]) -> f64) -> Vec<VolumeLink> {
    let mut ends = Vec::new();
    for z_m in [0.5, 2.5, 5.5] {
        for step in 0..8 {
            let along_m = 0.6 + 1.25 * f64::from(step);
            ends.push([along_m, -0.5, z_m]);
            ends.push([along_m, 10.5, z_m]);
            ends.push([-0.5, along_m, z_m]);
            ends.push([10.5, along_m, z_m]);
        }
    }
    let mut links = Vec::new();
    for (i, from) in ends.iter().enumerate() {
        for to in &ends[..i] {
            if from[0] == to[0] && (from[0] < 0.0 || from[0] > 10.0) {
                continue;
            }
            // Every other link is enough.
            if (links.len() + i) % 5 != 0 && (from[2] == to[2]) == (i % 2 == 0) {
                continue;
            }
            let mut link = VolumeLink {
                from_m: *from,
                to_m: *to,
                attenuation_db: 0.0,
                sd_db: 0.7,
                is_at_floor: false,
            };
            let row = voxels_of(&link, &GRID);
            link.attenuation_db = row
                .iter()
                .map(|(voxel, length_m)| length_m * truth(GRID.centre(*voxel as usize)))
                .sum();
            links.push(link);
        }
    }
    links
}

/// What links through a phantom show, with as much noise as they are said to have.
fn measured(truth: impl Fn([f64; 3]) -> f64, seed: u64) -> Vec<VolumeLink> {
    let mut noise = Noise::new(seed);
    let mut links = links(|_| 0.0);
    for link in &mut links {
        let row = voxels_of(link, &FINE);
        let on_way = row
            .iter()
            .map(|(voxel, length_m)| length_m * truth(FINE.centre(*voxel as usize)));
        link.attenuation_db = on_way.sum::<f64>() + link.sd_db * noise.normal();
    }
    links
}

/// Returns how far a volume is from a phantom, of the phantom's own size.
fn relative_error(volume: &Volume, truth: impl Fn([f64; 3]) -> f64) -> f64 {
    let mut means = vec![0.0; GRID.voxels()];
    let mut counts = vec![0.0; GRID.voxels()];
    for index in 0..FINE.voxels() {
        let at = FINE.centre(index);
        let place = [0, 1, 2].map(|axis| (at[axis] / GRID.side_m(axis)) as usize);
        means[GRID.index(place)] += truth(at);
        counts[GRID.index(place)] += 1.0;
    }
    let (mut off, mut all) = (0.0, 0.0);
    for index in 0..GRID.voxels() {
        let is = means[index] / counts[index];
        off += (volume.values[index] - is).powi(2);
        all += is * is;
    }
    (off / all).sqrt()
}

#[test]
fn every_solver_of_pixels_makes_volumes_and_auto_is_nearer_the_truth_than_the_smooth_ones() {
    type Phantom = fn([f64; 3]) -> f64;
    let phantoms: [(&str, Phantom, f64); 3] = [
        ("boxes", truth, 0.55),
        ("wall", wall, 0.55),
        ("persons", persons, 0.85),
    ];
    for (seed, (phantom, truth, most)) in phantoms.into_iter().enumerate() {
        let links = measured(truth, seed as u64);
        let errors = solvers().map(|(name, solver)| {
            let volume = reconstruct_volume(&links, None, GRID, &solver, &|_| ()).unwrap();
            let error = relative_error(&volume, truth);
            let chosen = volume.choice.map_or(String::new(), |of| of.best.words());
            println!("{phantom} by {name}: {error:.3} {chosen}");
            assert!(volume.used > 1_700, "{name}: {}", volume.used);
            error
        });
        let [map, tikhonov, tsvd, nn, tv, auto] = errors;
        assert!(auto < most && auto <= 1.001 * nn.max(tv), "{phantom}");
        assert!(auto < 0.95 * map.min(tikhonov).min(tsvd), "{phantom}");
    }
}

#[test]
fn persons_are_not_drawn_on_voxels() {
    let area = Rect::new(Point::new(0.0, 0.0), Point::new(10.0, 10.0));
    let points = Solver::Points(ImagingSettings::sparse_for(area));
    let links = links(persons);
    assert_eq!(
        reconstruct_volume(&links[..50], None, GRID, &points, &|_| ()),
        Err(VolumeError::Persons)
    );
}

#[test]
fn the_pieces_of_a_link_sum_up_to_its_length_within() {
    let link = |from_m, to_m| VolumeLink {
        from_m,
        to_m,
        attenuation_db: 0.0,
        sd_db: 1.0,
        is_at_floor: false,
    };
    for (from_m, to_m, expected_m) in [
        ([-1.0, 5.2, 3.3], [11.0, 5.2, 3.3], 10.0),
        ([0.3, 0.4, -1.0], [0.3, 0.4, 9.0], 6.0),
        ([0.0, 0.0, 0.0], [10.0, 10.0, 6.0], 236f64.sqrt()),
        ([-1.0, -1.0, 3.0], [-1.0, 9.0, 3.0], 0.0),
        ([2.0, 2.0, 2.0], [2.0, 2.0, 2.0], 0.0),
    ] {
        let row = voxels_of(&link(from_m, to_m), &GRID);
        let sum_m: f64 = row.iter().map(|(_, length_m)| length_m).sum();
        assert!((sum_m - expected_m).abs() < 1e-9, "{from_m:?}: {sum_m}");
    }
}

#[test]
fn two_boxes_at_two_heights_are_told_apart() {
    let volume = reconstruct_volume(&links(truth), None, GRID, &map(), &|_| ()).unwrap();
    let mean = |low: [f64; 3], high: [f64; 3]| {
        let inside = |index: &usize| {
            let at = GRID.centre(*index);
            (0..3).all(|axis| at[axis] > low[axis] && at[axis] < high[axis])
        };
        let all: Vec<f64> = (0..GRID.voxels())
            .filter(inside)
            .map(|index| volume.values[index])
            .collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    let (west, above_west) = (
        mean([2.0, 4.0, 0.0], [3.5, 6.0, 2.0]),
        mean([2.0, 4.0, 4.0], [3.5, 6.0, 6.0]),
    );
    let (east, below_east) = (
        mean([6.5, 5.0, 4.0], [8.0, 6.5, 6.0]),
        mean([6.5, 5.0, 0.0], [8.0, 6.5, 2.0]),
    );
    assert!(
        west > 2.0 && west > 4.0 * above_west.abs(),
        "{west} {above_west}"
    );
    assert!(
        east > 2.0 && east > 4.0 * below_east.abs(),
        "{east} {below_east}"
    );
    assert!(truth(GRID.centre(volume.strongest())) > 0.0);
    assert_eq!(volume.layer(5).len(), 400);
}

#[test]
fn a_world_turned_upside_down_gives_the_image_upside_down() {
    let turned = |at: [f64; 3]| [at[0], at[1], 6.0 - at[2]];
    let upright = links(truth);
    let mirrored: Vec<VolumeLink> = upright
        .iter()
        .map(|link| VolumeLink {
            from_m: turned(link.from_m),
            to_m: turned(link.to_m),
            ..*link
        })
        .collect();
    for (name, solver) in solvers() {
        let [one, other] = [&upright, &mirrored]
            .map(|links| reconstruct_volume(&links[..300], None, GRID, &solver, &|_| ()).unwrap());
        for index in 0..GRID.voxels() {
            let [column, row, layer] = GRID.place(index);
            let below = GRID.index([column, row, 5 - layer]);
            let off = one.values[index] - other.values[below];
            assert!(off.abs() < 1e-6, "{name}: {off}");
        }
    }
}

#[test]
fn links_beside_the_volume_make_none() {
    let far = VolumeLink {
        from_m: [20.0; 3],
        to_m: [30.0; 3],
        attenuation_db: 3.0,
        sd_db: 1.0,
        is_at_floor: false,
    };
    assert_eq!(
        reconstruct_volume(&[far], None, GRID, &map(), &|_| ()),
        Err(VolumeError::NoLinks)
    );
    assert_eq!(
        reconstruct_volume(&[], None, GRID, &map(), &|_| ()),
        Err(VolumeError::NoLinks)
    );
}
