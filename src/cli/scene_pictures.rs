//! The two pictures of a scene: the floor plan, and the view from a place.

use std::thread::ScopedJoinHandle;

use super::error::CliError;
use super::load::LoadedScene;
use super::pictures::{drawn, homes, persons};
use crate::draw::{COLOURS, FloorPlan, FloorShape, Overlay, Picture};
use crate::geom::{Angle, Point, Rect};
use crate::scene::{Camera, RayHit, Scene, Viewpoint};

/// Heights above the plan's at which it is looked for what hangs or rises there.
const CUTS_ABOVE: usize = 12;
/// Rays along each side of a pixel.
const RAYS: usize = 2;
const PERSON: [u8; 3] = [206, 58, 46];
const GROUND: [u8; 3] = [206, 200, 184];
const HORIZON: [f64; 3] = [226.0, 234.0, 241.0];
const ZENITH: [f64; 3] = [112.0, 158.0, 210.0];
/// Distance over which two thirds of a colour fade into the horizon, metres.
const HAZE_M: f64 = 600.0;
/// What full light makes of a colour; level ground gets about 0.85 of it.
const EXPOSURE: f64 = 1.17;
/// Lines on the ground, one metre apart: how wide, and up to where they are drawn, metres.
const LINE_M: f64 = 0.015;
const LINES_TO_M: f64 = 40.0;

/// How a scene is looked at.
pub(super) struct SceneView {
    /// The pose asked for; `None`: one from which everything is seen.
    pub(super) pose: Option<Viewpoint>,
    /// Width and height of the view.
    pub(super) size_px: (usize, usize),
    /// What the view shows from side to side.
    pub(super) field_rad: f64,
    /// Height of the plan's cut.
    pub(super) height_m: f64,
}

impl SceneView {
    /// Returns where the view is from: the pose asked for, or one above the south-west that shows everything.
    pub(super) fn viewpoint(&self, depicted: &LoadedScene) -> Viewpoint {
        if let Some(pose) = self.pose {
            return pose;
        }
        let shown = shown(depicted);
        let top_m = depicted
            .scene
            .extent()
            .map_or(0.0, |(_, high)| high[2].max(0.0));
        let reach_m = shown.width_m().hypot(shown.height_m()) / 2.0;
        let (wide, high) = self.size_px;
        let half_rad = (self.field_rad / 2.0)
            .min(((self.field_rad / 2.0).tan() * high as f64 / wide as f64).atan());
        let away_m = 0.60 * reach_m.max(top_m).max(1.0) / half_rad.sin();
        let (yaw, pitch_rad) = (Angle::from_degrees(62.0), -36f64.to_radians());
        let back_m = away_m * pitch_rad.cos();
        let middle = shown.centre();
        let at = [
            middle.x_m - back_m * yaw.radians().cos(),
            middle.y_m - back_m * yaw.radians().sin(),
            top_m / 4.0 - away_m * pitch_rad.sin(),
        ];
        Viewpoint { at, yaw, pitch_rad }
    }
}

/// What things are made of, for the eye: names and colours, and which thing has which.
struct Kinds {
    list: Vec<(String, [u8; 3])>,
    of_object: Vec<usize>,
}

impl Kinds {
    fn new(depicted: &LoadedScene) -> Kinds {
        let file = &depicted.file;
        let objects = depicted.scene.objects();
        let mut kinds = Kinds {
            list: Vec::new(),
            of_object: Vec::new(),
        };
        let shapes = objects.len() - depicted.persons.len() - file.objects.len();
        for (index, object) in objects.iter().enumerate() {
            let (name, colour) = match index.checked_sub(shapes) {
                None => match file.materials.get(&object.name) {
                    Some(material) => (object.name.as_str(), material.colour),
                    None => ("other shapes", file.default_material.colour),
                },
                Some(post) => match file.objects.get(post).map(|object| object.material.colour) {
                    Some(Some(colour)) => (object.name.as_str(), Some(colour)),
                    Some(None) => ("objects", None),
                    None => ("persons", Some(PERSON)),
                },
            };
            let kind = kinds.place_of(name, colour);
            kinds.of_object.push(kind);
        }
        kinds
    }

    fn place_of(&mut self, name: &str, colour: Option<[u8; 3]>) -> usize {
        if let Some(known) = self.list.iter().position(|(other, _)| other == name) {
            return known;
        }
        let colour = colour.unwrap_or(COLOURS[self.list.len() % COLOURS.len()]);
        self.list.push((name.to_owned(), colour));
        self.list.len() - 1
    }

    fn colour(&self, object: usize) -> [u8; 3] {
        let kind = self
            .of_object
            .get(object)
            .and_then(|kind| self.list.get(*kind));
        kind.map_or(COLOURS[0], |(_, colour)| *colour)
    }
}

/// Returns what the pictures show in the plane: the fence of a simulation, else all that stands there.
fn shown(depicted: &LoadedScene) -> Rect {
    if let Some(sim) = &depicted.sim {
        return around(sim.venue.fence.corners());
    }
    match depicted.scene.extent() {
        Some((low, high)) => Rect::new(Point::new(low[0], low[1]), Point::new(high[0], high[1])),
        None => Rect::new(Point::new(0.0, 0.0), Point::new(10.0, 10.0)),
    }
}

fn around(corners: &[Point]) -> Rect {
    let least = |of: fn(&Point) -> f64| corners.iter().map(of).fold(f64::INFINITY, f64::min);
    let most = |of: fn(&Point) -> f64| corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
    let low = Point::new(least(|corner| corner.x_m), least(|corner| corner.y_m));
    Rect::new(
        low,
        Point::new(most(|corner| corner.x_m), most(|corner| corner.y_m)),
    )
}

/// Draws the floor plan as PNG.
///
/// # Errors
/// The picture cannot be made.
pub(super) fn draw_plan(depicted: &LoadedScene, look: &SceneView) -> Result<Vec<u8>, CliError> {
    let kinds = Kinds::new(depicted);
    let top_m = depicted.scene.extent().map_or(0.0, |(_, high)| high[2]);
    let step_m = (top_m - look.height_m) / (CUTS_ABOVE as f64 + 0.5);
    let above = (1..=CUTS_ABOVE)
        .filter(|_| step_m > 0.0)
        .map(|cut| look.height_m + step_m * cut as f64);
    let mut shapes: Vec<FloorShape> = Vec::new();
    for (height_m, is_above) in above
        .map(|height_m| (height_m, true))
        .chain([(look.height_m, false)])
    {
        shapes.extend(
            depicted
                .scene
                .outlines(height_m)
                .into_iter()
                .map(|outline| FloorShape {
                    material: kinds
                        .of_object
                        .get(outline.object)
                        .copied()
                        .unwrap_or_default(),
                    polygon: outline.polygon,
                    holes: outline.holes,
                    is_above,
                }),
        );
    }
    let title = format!("{}, cut at {} m", depicted.name, look.height_m);
    let overlays = overlays(depicted, look);
    let plan = FloorPlan {
        title,
        area: shown(depicted),
        materials: &kinds.list,
        shapes: &shapes,
        overlays,
    };
    drawn(Picture::floor(&plan))
}

fn overlays(depicted: &LoadedScene, look: &SceneView) -> Vec<Overlay> {
    let mut overlays = Vec::new();
    if let Some(sim) = &depicted.sim {
        overlays.push(Overlay::Fence {
            polygon: sim.venue.fence.clone(),
        });
        overlays.push(Overlay::Area {
            rect: sim.venue.area,
        });
        overlays.extend(homes(&sim.venue));
    }
    overlays.extend(persons(&depicted.persons));
    overlays.extend(look.pose.map(|pose| Overlay::Viewpoint {
        at: Point::new(pose.at[0], pose.at[1]),
    }));
    overlays
}

/// Draws the view as PNG, on all cores.
///
/// # Errors
/// The picture cannot be made.
pub(super) fn draw_view(depicted: &LoadedScene, look: &SceneView) -> Result<Vec<u8>, CliError> {
    let (columns, rows) = look.size_px;
    let camera = Camera::new(&look.viewpoint(depicted), columns, rows, look.field_rad);
    let kinds = Kinds::new(depicted);
    let eye = Eye {
        scene: &depicted.scene,
        camera,
        kinds: &kinds,
    };
    let cores = std::thread::available_parallelism()
        .map_or(1, usize::from)
        .min(rows);
    let mut pixels = vec![[0u8; 3]; columns * rows];
    let band = rows.div_ceil(cores);
    std::thread::scope(|scope| {
        let bands = pixels.chunks_mut(columns * band).enumerate();
        let paint = |(index, band_pixels): (usize, &mut [[u8; 3]])| {
            for (place, pixel) in band_pixels.iter_mut().enumerate() {
                *pixel = eye.pixel(place % columns, index * band + place / columns);
            }
        };
        let painters: Vec<ScopedJoinHandle<'_, ()>> =
            bands.map(|band| scope.spawn(move || paint(band))).collect();
        for painter in painters {
            if let Err(panic) = painter.join() {
                std::panic::resume_unwind(panic);
            }
        }
    });
    drawn(Picture::photo(columns, &pixels))
}

/// Turns what is seen into colours.
struct Eye<'a> {
    scene: &'a Scene,
    camera: Camera,
    kinds: &'a Kinds,
}

impl Eye<'_> {
    /// Returns the mean colour of a pixel.
    fn pixel(&self, column: usize, row: usize) -> [u8; 3] {
        let mut sum = [0.0; 3];
        for ray in 0..RAYS * RAYS {
            let part = |index: usize| (index as f64 + 0.5) / RAYS as f64;
            let (x_px, y_px) = (
                column as f64 + part(ray % RAYS),
                row as f64 + part(ray / RAYS),
            );
            let colour = self.colour(self.camera.direction(x_px, y_px));
            sum = [0, 1, 2].map(|channel| sum[channel] + colour[channel]);
        }
        sum.map(|channel| (channel / (RAYS * RAYS) as f64).round().clamp(0.0, 255.0) as u8)
    }

    fn colour(&self, direction: [f64; 3]) -> [f64; 3] {
        match self.scene.seen(self.camera.from(), direction) {
            RayHit::Sky { rise } => mix(HORIZON, ZENITH, rise.clamp(0.0, 1.0).sqrt()),
            RayHit::Ground { at, light } => self.hazy(GROUND, at, light * self.lines(at)),
            RayHit::Surface {
                object,
                at,
                is_level,
                light,
            } => {
                let is_floor = is_level && at[2].abs() < 0.1;
                let lines = if is_floor { self.lines(at) } else { 1.0 };
                self.hazy(self.kinds.colour(object), at, light * lines)
            }
        }
    }

    /// Returns a colour in a light, paler with the distance.
    fn hazy(&self, colour: [u8; 3], at: [f64; 3], light: f64) -> [f64; 3] {
        let near = colour.map(|channel| f64::from(channel) * EXPOSURE * light);
        mix(near, HORIZON, 1.0 - (-self.distance_m(at) / HAZE_M).exp())
    }

    /// Returns how much darker the ground is on the lines that show metres.
    fn lines(&self, at: [f64; 3]) -> f64 {
        let off_m = |part: f64| (part - part.round()).abs();
        let is_on = off_m(at[0]).min(off_m(at[1])) < LINE_M;
        let strength = 0.22 * (1.0 - self.distance_m(at) / LINES_TO_M).clamp(0.0, 1.0);
        if is_on { 1.0 - strength } else { 1.0 }
    }

    fn distance_m(&self, at: [f64; 3]) -> f64 {
        let from = self.camera.from();
        (0..3)
            .map(|axis| (at[axis] - from[axis]).powi(2))
            .sum::<f64>()
            .sqrt()
    }
}

fn mix(one: [f64; 3], other: [f64; 3], share: f64) -> [f64; 3] {
    [0, 1, 2].map(|channel| one[channel] + (other[channel] - one[channel]) * share)
}
