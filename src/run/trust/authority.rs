//! The authority of a swarm: it signs certificates and rosters. Keeps its key in memory only; where it lies on disk is
//! the caller's.

use std::net::IpAddr;

use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose, PKCS_ECDSA_P256_SHA256, SanType, SerialNumber, SigningKey,
    date_time_ymd,
};
use ring::rand::{SecureRandom, SystemRandom};

use super::certificate::{Certificate, CertificateError};
use super::name::CommonName;
use super::roster::{Roster, RosterEntry};

/// Why an authority cannot do what it is asked.
#[derive(Debug, thiserror::Error)]
pub enum AuthorityError {
    /// The key or the certificate cannot be made or read.
    #[error("the authority: {0}")]
    Key(#[from] rcgen::Error),
    /// The certificate of the authority is none.
    #[error("the authority's certificate {0}")]
    Certificate(#[from] CertificateError),
    /// The key is not that of the certificate.
    #[error("the authority's key does not belong to its certificate")]
    OtherKey,
    /// The machine gives no random numbers.
    #[error("the machine gives no random numbers")]
    Random,
    /// A host is neither an address nor a name.
    #[error("\"{0}\" is no host; an IP address or a host name is expected")]
    Host(String),
}

/// A certificate for a node, with its private key.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct IssuedCertificate {
    /// How the roster names it.
    pub entry: RosterEntry,
    /// The certificate (PEM).
    pub certificate_pem: String,
    /// The private key (PKCS #8, PEM).
    pub key_pem: String,
}

/// Signs for a swarm.
pub struct Authority {
    certificate: Certificate,
    certificate_pem: String,
    issuer: Issuer<'static, KeyPair>,
}

impl Authority {
    /// Makes a new authority with a key of its own.
    ///
    /// # Errors
    /// The machine cannot make keys.
    pub fn create() -> Result<Authority, AuthorityError> {
        let key = KeyPair::generate_for(&PKCS_ECDSA_P256_SHA256)?;
        let serial = random_serial()?;
        let mut params = params(
            &format!("tomoswarm authority {}", hex(&serial[..4])),
            &serial,
        );
        params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
        let certificate_pem = params.self_signed(&key)?.pem();
        Authority::open(&certificate_pem, &key.serialize_pem())
    }

    /// Makes an authority of its certificate and its key (both PEM).
    ///
    /// # Errors
    /// They are none, or do not belong together.
    pub fn open(certificate_pem: &str, key_pem: &str) -> Result<Authority, AuthorityError> {
        let certificate = Certificate::from_pem(certificate_pem)?;
        if !certificate.is_authority {
            return Err(CertificateError::NoAuthority.into());
        }
        let key = KeyPair::from_pem(key_pem)?;
        if key.public_key_raw() != certificate.public_key {
            return Err(AuthorityError::OtherKey);
        }
        let issuer = Issuer::from_ca_cert_pem(certificate_pem, key)?;
        Ok(Authority {
            certificate,
            certificate_pem: certificate_pem.to_owned(),
            issuer,
        })
    }

    /// Returns its certificate.
    pub fn certificate(&self) -> &Certificate {
        &self.certificate
    }

    /// Returns its certificate, which every node gets (PEM).
    pub fn certificate_pem(&self) -> &str {
        &self.certificate_pem
    }

    /// Returns its private key, which nobody gets (PKCS #8, PEM).
    pub fn key_pem(&self) -> String {
        self.issuer.key().serialize_pem()
    }

    /// Issues a certificate for a node that is reached under these hosts, and on its own machine.
    ///
    /// # Errors
    /// A host is none; no key can be made.
    pub fn issue(
        &self,
        name: CommonName,
        hosts: &[String],
    ) -> Result<IssuedCertificate, AuthorityError> {
        let key = KeyPair::generate_for(&PKCS_ECDSA_P256_SHA256)?;
        let mut params = params(&name.to_string(), &random_serial()?);
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![
            ExtendedKeyUsagePurpose::ServerAuth,
            ExtendedKeyUsagePurpose::ClientAuth,
        ];
        params.use_authority_key_identifier_extension = true;
        params.subject_alt_names = alternative_names(hosts)?;
        let certificate_pem = params.signed_by(&key, &self.issuer)?.pem();
        let Certificate {
            serial,
            fingerprint,
            ..
        } = Certificate::from_pem(&certificate_pem)?;
        let entry = RosterEntry {
            name,
            serial,
            fingerprint,
        };
        Ok(IssuedCertificate {
            entry,
            certificate_pem,
            key_pem: key.serialize_pem(),
        })
    }

    /// Returns a roster as text, signed.
    ///
    /// # Errors
    /// The key cannot sign.
    pub fn sign(&self, roster: &Roster) -> Result<String, AuthorityError> {
        let text = roster.unsigned_text();
        let signature = self.issuer.key().sign(text.as_bytes())?;
        Ok(Roster::with_signature(&text, &signature))
    }
}

/// Returns whether a text is an IP address or a host name that a certificate may carry.
pub fn is_host(text: &str) -> bool {
    text.parse::<IpAddr>().is_ok() || crate::config::is_host(text)
}

fn alternative_names(hosts: &[String]) -> Result<Vec<SanType>, AuthorityError> {
    let mut names = Vec::new();
    for host in ["127.0.0.1", "::1", "localhost"]
        .into_iter()
        .chain(hosts.iter().map(String::as_str))
    {
        let refused = || AuthorityError::Host(host.to_owned());
        if !is_host(host) {
            return Err(refused());
        }
        let name = match host.parse::<IpAddr>() {
            Ok(address) => SanType::IpAddress(address),
            Err(_) => SanType::DnsName(host.try_into().map_err(|_| refused())?),
        };
        if !names.contains(&name) {
            names.push(name);
        }
    }
    Ok(names)
}

/// Returns what all certificates share: they hold for ever, since a Pi has no clock (RFC 5280, 4.1.2.5: 9999 is for ever).
fn params(common_name: &str, serial: &[u8]) -> CertificateParams {
    let mut params = CertificateParams::default();
    let mut name = DistinguishedName::new();
    name.push(DnType::CommonName, common_name);
    params.distinguished_name = name;
    params.serial_number = Some(SerialNumber::from_slice(serial));
    params.not_before = date_time_ymd(1970, 1, 1);
    params.not_after = date_time_ymd(9999, 12, 31);
    params
}

/// Returns a random serial number: positive, and never shorter than it looks.
fn random_serial() -> Result<[u8; 16], AuthorityError> {
    let mut serial = [0; 16];
    SystemRandom::new()
        .fill(&mut serial)
        .map_err(|_| AuthorityError::Random)?;
    serial[0] = serial[0] & 0x7f | 0x40;
    Ok(serial)
}

fn hex(bytes: &[u8]) -> String {
    super::certificate::to_hex(bytes)
}
