//! The `.fmu` archive.

use std::io::{self, Cursor, Read as _, Write as _};
use std::path::{Path, PathBuf};

use wheeleg_config::open_file;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::description::{self, Fmi};
use crate::error::FmuError;
use crate::model::{AXIS_FILE, IDENTIFIER, Model, UNIT_FILE};

/// File name of the shared library as cargo builds it.
pub const LIBRARY: &str = if cfg!(target_os = "windows") {
    "wheeleg_fmu.dll"
} else if cfg!(target_os = "macos") {
    "libwheeleg_fmu.dylib"
} else {
    "libwheeleg_fmu.so"
};

/// Folder and file name of the library in a unit, as each version names the platform.
fn binary(fmi: Fmi) -> String {
    let (os, suffix) = match std::env::consts::OS {
        "windows" => ("windows", "dll"),
        "macos" => ("darwin", "dylib"),
        os => (os, "so"),
    };
    let folder = match fmi {
        Fmi::Three => format!("{}-{os}", std::env::consts::ARCH),
        Fmi::Two => match os {
            "windows" => "win64".to_owned(),
            os => format!("{os}64"),
        },
    };
    format!("binaries/{folder}/{IDENTIFIER}.{suffix}")
}

/// The shared library beside the running program, where cargo puts both.
#[must_use]
pub fn library_beside_program() -> PathBuf {
    let program = std::env::current_exe().unwrap_or_default();
    program.with_file_name(LIBRARY)
}

/// The shared library: a file for this computer with both interfaces in it.
fn read(library: &Path) -> Result<Vec<u8>, FmuError> {
    let no = |reason: String| FmuError::Library {
        path: library.to_owned(),
        reason,
    };
    let mut code = Vec::new();
    let read = open_file(library).and_then(|mut file| file.read_to_end(&mut code));
    read.map_err(|e| no(e.to_string()))?;
    let head: &[u8] = match std::env::consts::OS {
        "windows" => b"MZ",
        "macos" => &[0xCF, 0xFA, 0xED, 0xFE],
        _ => b"\x7fELF",
    };
    let has = |name: &str| code.windows(name.len()).any(|at| at == name.as_bytes());
    if !code.starts_with(head) {
        return Err(no("it is not program code for this computer".to_owned()));
    }
    if !(has("fmi2Instantiate") && has("fmi3InstantiateCoSimulation")) {
        return Err(no("it lacks the functions of FMI".to_owned()));
    }
    Ok(code)
}

/// The unit of a model, with a shared library, as bytes. The same model and library give the same
/// bytes.
///
/// # Errors
/// [`FmuError::Library`] if it is not there or another file, [`FmuError::Archive`] if the unit cannot
/// be packed.
pub fn pack(model: &Model, fmi: Fmi, library: &Path) -> Result<Vec<u8>, FmuError> {
    let code = read(library)?;
    let packed = || -> io::Result<Vec<u8>> {
        let files = [
            (
                "modelDescription.xml".to_owned(),
                description::write(model, fmi)?,
            ),
            (binary(fmi), code),
            (
                format!("resources/{AXIS_FILE}"),
                model.text.clone().into_bytes(),
            ),
            (format!("resources/{UNIT_FILE}"), model.about().into_bytes()),
        ];
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(zip::DateTime::default())
            .unix_permissions(0o755);
        for (name, content) in files {
            zip.start_file(name, options)?;
            zip.write_all(&content)?;
        }
        Ok(zip.finish()?.into_inner())
    };
    packed().map_err(|e| FmuError::Archive {
        path: library.to_owned(),
        reason: e.to_string(),
    })
}
