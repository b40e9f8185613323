//! The operator's page without its network: what it shows, in which frames, to whom they go when, and who may do what.
//!
//! [`board`] keeps the newest of everything that was heard, [`outbox`] chooses what goes to one page next, [`frame`] says which
//! bytes that is and [`told`] what its texts say, [`timetable`], [`radio`] and [`events`] make of what was heard the plans
//! against time, who hears whom, and what happened, [`links`] and [`why`] what made a pixel, [`marks`] where somebody truly
//! stands, [`scene_mesh`] what stands in a simulation, [`cell_view`] who has seen a cell, [`pair_history`] how strongly a pair
//! was heard, [`ghost`] where another run was, [`history`] keeps what was told and [`playback`] shows another time of it, [`gate`] judges who may look and order, and
//! [`page_server`] joins them:
//! it is told what was heard, what pages and requests say, and the time, and says what is to be sent, told to the operator,
//! and published. Nothing here opens a port; the server around it is `run/dash`, the page is `web/`.

pub mod board;
pub mod cell_view;
pub mod contents;
mod deflate;
pub mod events;
pub mod frame;
pub mod gate;
pub mod geojson;
pub mod ghost;
pub mod given;
pub mod heard_files;
pub mod history;
pub mod links;
pub mod look_view;
pub mod marks;
pub mod metrics;
pub mod newest_image;
mod node_settings;
pub mod orders;
pub mod outbox;
pub mod page_server;
pub mod pair_history;
pub mod playback;
pub mod radio;
pub mod records;
pub mod run_files;
pub mod sample_book;
pub mod scene_mesh;
mod shown_cells;
pub mod texts;
pub mod timetable;
pub mod told;
pub mod track;
pub mod why;
