//! Settings files, scenes and calibrations of pixels: any text is one, or one clear line.

use std::fs;

use dtof_core::Array;
use dtof_data::photons::geometry::Rays;
use dtof_engine::settings::SettingsFile;
use dtof_light::scene::Scene;

use crate::{folder, is_one_line};

/// What is read is written, and read again as the same.
pub fn settings(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    match SettingsFile::parse(text) {
        Ok(settings) => {
            let written = settings.to_toml().expect("settings that were read");
            let again = SettingsFile::parse(&written).expect("settings that were written");
            assert_eq!(again, settings);
            // Values that fit may not fit each other.
            if let Err(error) = settings.settings(128) {
                is_one_line(&error);
            }
        }
        Err(error) => is_one_line(&error),
    }
    match Scene::parse(text) {
        Ok(scene) => {
            // Few enough pixels not to take seconds.
            if scene.size[0] * scene.size[1] <= 64
                && scene.surfaces.len() < 10
                && let Err(error) = scene.photons(1, 4)
            {
                is_one_line(&error);
            }
        }
        Err(error) => is_one_line(&error),
    }
    // A calibration has nothing but these.
    if text.contains("pixels") {
        let folder = folder();
        let path = folder.path().join("a.toml");
        fs::write(&path, text).expect("a file");
        if let Err(error) = Rays::read(&path, const { Array::new(2, 1).unwrap() }) {
            is_one_line(&error);
        }
    }
}
