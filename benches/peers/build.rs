//! Builds the C++ wrappers between Rust and Bullet and Jolt (feature `cpp`); physx-sys contains its own.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    #[cfg(feature = "cpp")]
    {
        bullet();
        jolt();
    }
}

/// Bullet as packaged by Debian, in single precision.
#[cfg(feature = "cpp")]
fn bullet() {
    let headers = "/usr/include/bullet";
    if !std::path::Path::new(headers).is_dir() {
        panic!("no {headers}: install libbullet-dev, or build without the feature cpp");
    }
    println!("cargo:rerun-if-changed=src/bullet.cpp");
    cc::Build::new()
        .cpp(true)
        .std("c++17")
        .include(headers)
        .warnings(false)
        .opt_level(3)
        .file("src/bullet.cpp")
        .compile("peers_bullet");
    println!("cargo:rustc-link-lib=BulletCollision");
    println!("cargo:rustc-link-lib=LinearMath");
}

/// Jolt as joltc-sys builds it. The options equal those of its CMake file: others would change struct layouts, which
/// Jolt detects at startup (`VerifyJoltVersionID`).
#[cfg(feature = "cpp")]
fn jolt() {
    println!("cargo:rerun-if-changed=src/jolt.cpp");
    let mut build = cc::Build::new();
    build
        .cpp(true)
        .std("c++17")
        .include(jolt_headers())
        .warnings(false)
        .opt_level(3)
        .define("NDEBUG", None)
        .define("JPH_DEBUG_RENDERER", None)
        .define("JPH_PROFILE_ENABLED", None);
    if std::env::var("CARGO_CFG_TARGET_ARCH").is_ok_and(|arch| arch == "x86_64") {
        for flag in ["avx2", "bmi", "popcnt", "lzcnt", "f16c", "fma"] {
            build.flag(format!("-m{flag}"));
        }
        for set in [
            "AVX2", "AVX", "SSE4_1", "SSE4_2", "LZCNT", "TZCNT", "F16C", "FMADD",
        ] {
            build.define(&format!("JPH_USE_{set}"), None);
        }
    }
    build.file("src/jolt.cpp").compile("peers_jolt");
}

/// Folder of the sources of joltc-sys; its build script does not export the path, so `cargo metadata` is asked.
#[cfg(feature = "cpp")]
fn jolt_headers() -> std::path::PathBuf {
    let variable = |name: &str| std::env::var(name).expect("cargo sets it");
    let output = std::process::Command::new(variable("CARGO"))
        .args([
            "metadata",
            "--format-version=1",
            "--offline",
            "--all-features",
        ])
        .args(["--filter-platform", &variable("TARGET")])
        .output()
        .expect("cargo runs");
    let text = String::from_utf8_lossy(&output.stdout);
    let manifest = text
        .split(r#""manifest_path":""#)
        .filter_map(|rest| rest.split('"').next())
        .find(|path| path.contains("joltc-sys"))
        .unwrap_or_else(|| {
            let error = String::from_utf8_lossy(&output.stderr);
            panic!("cargo metadata knows no joltc-sys: {error}")
        });
    let folder = std::path::Path::new(manifest).with_file_name("");
    folder.join("JoltC/JoltPhysics")
}
