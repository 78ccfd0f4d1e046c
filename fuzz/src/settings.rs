//! Settings files and scenes: any text is one, or one clear line.

use dtof::settings::SettingsFile;
use dtof::simulate::scene::Scene;

/// What is read is written, and read again as the same.
pub fn settings(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    match SettingsFile::parse(text) {
        Ok(settings) => {
            let written = settings.to_toml().expect("settings that were read");
            let again = SettingsFile::parse(&written).expect("settings that were written");
            assert_eq!(again.to_toml().expect("the same"), written);
            // Values that fit may not fit each other: an error then, and no more.
            let _ = settings.settings(128);
        }
        Err(error) => assert!(!format!("{error:#}").is_empty()),
    }
    if let Ok(scene) = Scene::parse(text) {
        // Few enough pixels not to take seconds.
        if scene.geometry.addresses() <= 64 && scene.surfaces.len() < 10 {
            let _ = scene.photons(1, 4);
        }
    }
}
