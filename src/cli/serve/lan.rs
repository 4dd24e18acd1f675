//! `roomsight serve --lan`: phones and laptops of the same network come in, over TLS, without an account elsewhere.
//!
//! Browsers give a camera only to pages that came over HTTPS. Nobody has a certificate for the address of a laptop, so that the
//! service makes one of its own, which browsers warn of once.

use crate::cli::output::say;
use crate::http::{self, App};
use crate::settings::Settings;
use anyhow::Context;
use chrono::{Datelike, Days, Utc};
use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;
use rcgen::{CertificateParams, KeyPair, date_time_ymd};
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::net::{IpAddr, SocketAddr};
use std::path::Path;
use std::time::{Duration, SystemTime};

/// Where it listens, if nothing else was said.
const LISTEN: &str = "0.0.0.0:8080";
/// The folder of the certificate, in the data directory.
const FOLDER: &str = "certificate";
const CERTIFICATE_FILE: &str = "certificate.pem";
const KEY_FILE: &str = "key.pem";
/// The names that the certificate is for.
const NAMES_FILE: &str = "names.txt";
/// How long a certificate is valid: browsers take none that is for more than 825 days.
const DAYS_VALID: u64 = 800;
/// A certificate is made anew when it is so old.
const DAYS_USED: u64 = 700;
/// How long the printed codes can be used.
const CODE_LIFE: Duration = Duration::from_secs(15 * 60);

/// Sets an address that others reach, where none was given, and a certificate, where there is none.
pub(super) fn prepare(settings: &mut Settings, has_default_address: bool) -> anyhow::Result<()> {
    if has_default_address && settings.listen == Settings::default().listen {
        LISTEN.clone_into(&mut settings.listen);
    }
    if settings.tls_certificate.as_os_str().is_empty() {
        let folder = settings.data.join(FOLDER);
        see_to_certificate(&folder).with_context(|| format!("the certificate in {}", folder.display()))?;
        settings.tls_certificate = folder.join(CERTIFICATE_FILE);
        settings.tls_key = folder.join(KEY_FILE);
    }
    Ok(())
}

/// Prints how to come in. `secret` is what opens the key that was made just now.
pub(super) fn invite(app: &App, secret: Option<&str>, listening: SocketAddr) -> anyhow::Result<()> {
    let port = listening.port();
    let link = |host: &str| -> anyhow::Result<Option<String>> {
        let code = app.admin_code(CODE_LIFE)?;
        Ok(code.map(|code| format!("https://{host}:{port}/#/code/{code}")))
    };
    if let Some(secret) = secret {
        say!("A key was made, by which you sign in later. It is told this once:\n\n  {secret}\n")?;
    }
    if !http::has_page() {
        say!("This program was built without the page, which takes Node 20: build it with `make`.")?;
        return Ok(());
    }
    if let Some(link) = link("localhost")? {
        say!("On this machine open, within 15 minutes and once:\n\n  {link}\n")?;
    }
    let is_reached = |address: &IpAddr| {
        address.is_ipv4() && (listening.ip().is_unspecified() || listening.ip() == *address)
    };
    let Some(address) = addresses().into_iter().find(is_reached) else {
        say!("The service has no address in a network that a phone could reach.")?;
        return Ok(());
    };
    if let Some(link) = link(&address.to_string())? {
        say!("On a phone in the same network point its camera here, within 15 minutes:\n")?;
        say!("{}", QrCode::new(&link)?.render::<Dense1x2>().build())?;
        say!("  {link}\n")?;
    }
    say!(
        "The browser will say that the connection is not private, since the certificate was made on this machine and nobody has \
         signed it. What is sent is encrypted all the same: choose Advanced, then to go on.\n"
    )?;
    Ok(())
}

/// Makes a certificate where there is none for the addresses of this machine, or one that is old.
fn see_to_certificate(folder: &Path) -> anyhow::Result<()> {
    let mut names = vec!["localhost".to_owned()];
    names.extend(addresses().iter().map(IpAddr::to_string));
    names.push("127.0.0.1".to_owned());
    let names_file = folder.join(NAMES_FILE);
    let known = fs::read_to_string(&names_file).unwrap_or_default();
    let modified = fs::metadata(folder.join(CERTIFICATE_FILE)).and_then(|metadata| metadata.modified());
    let is_young = modified.is_ok_and(|modified| {
        let age = SystemTime::now().duration_since(modified).unwrap_or_default();
        age < Duration::from_secs(DAYS_USED * 24 * 3600)
    });
    if is_young && names.iter().all(|name| known.lines().any(|line| line == name)) {
        return Ok(());
    }
    let mut parameters = CertificateParams::new(names.clone())?;
    let now = Utc::now();
    let end = now.checked_add_days(Days::new(DAYS_VALID)).unwrap_or(now);
    let [from, until] = [now, end].map(|day| date_time_ymd(day.year(), day.month() as u8, day.day() as u8));
    parameters.not_before = from;
    parameters.not_after = until;
    let key = KeyPair::generate()?;
    let certificate = parameters.self_signed(&key)?;
    fs::create_dir_all(folder)?;
    write_secret(&folder.join(KEY_FILE), key.serialize_pem().as_bytes())?;
    fs::write(folder.join(CERTIFICATE_FILE), certificate.pem())?;
    fs::write(names_file, names.join("\n"))?;
    Ok(())
}

/// Writes a file that only its owner may read.
fn write_secret(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let _ = fs::remove_file(path);
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(path)?.write_all(bytes)
}

/// The addresses of this machine in its networks.
fn addresses() -> Vec<IpAddr> {
    let interfaces = if_addrs::get_if_addrs().unwrap_or_default();
    let mut addresses: Vec<IpAddr> =
        interfaces.iter().filter(|interface| !interface.is_loopback()).map(if_addrs::Interface::ip).collect();
    // Those of containers come last.
    addresses.sort_by_key(|address| address.to_string().starts_with("172."));
    addresses
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_certificate_is_made_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("certificate");
        see_to_certificate(&path).unwrap();
        let read = || fs::read_to_string(path.join(CERTIFICATE_FILE)).unwrap();
        let first = read();
        see_to_certificate(&path).unwrap();
        assert_eq!(read(), first);
        fs::write(path.join(NAMES_FILE), "elsewhere").unwrap();
        see_to_certificate(&path).unwrap();
        assert_ne!(read(), first, "it was for other addresses");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = fs::metadata(path.join(KEY_FILE)).unwrap().permissions().mode();
            assert_eq!(mode & 0o077, 0, "{mode:o}");
        }
    }
}
