//! Mutually authenticated TLS 1.3 with the drones' own keys: raw public keys (RFC 7250), no certificates.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use muster_machines::identity::{NodeId, SwarmId};
use quinn::crypto::rustls::{HandshakeData, QuicClientConfig, QuicServerConfig};
use quinn::{ConnectionError, TransportErrorCode};
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::client::{AlwaysResolvesClientRawPublicKeys, Resumption};
use rustls::crypto::{
    CryptoProvider, WebPkiSupportedAlgorithms, ring, verify_tls13_signature_with_raw_key,
};
use rustls::pki_types::{CertificateDer, ServerName, SubjectPublicKeyInfoDer, UnixTime, alg_id};
use rustls::server::danger::{ClientCertVerified, ClientCertVerifier};
use rustls::server::{AlwaysResolvesServerRawPublicKeys, NoServerSessionStorage};
use rustls::sign::{CertifiedKey, Signer, SigningKey, public_key_to_spki};
use rustls::{
    AlertDescription, CertificateError, DigitallySignedStruct, DistinguishedName, Error,
    SignatureAlgorithm, SignatureScheme, version,
};

use super::identity::{Distrust, Identities, Peer, PublicKey};

/// Prefix of an Ed25519 `SubjectPublicKeyInfo` (RFC 8410, section 4).
const SPKI_PREFIX: [u8; 12] = [
    0x30, 0x2a, 0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70, 0x03, 0x21, 0x00,
];

/// Application protocol (ALPN) of operators.
pub(super) const OPERATOR: &[u8] = b"muster-operator/1";

/// Application protocol (ALPN) of a swarm. Drones of other swarms are refused by it.
pub(super) fn swarm_protocol(swarm: SwarmId) -> Vec<u8> {
    format!("muster-swarm/1/{}", swarm.0).into_bytes()
}

/// Why an attempt to connect failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Refusal {
    /// No drone of the fleet has the peer's key.
    Stranger,
    /// The peer is revoked.
    Revoked,
    /// The peer is not the drone expected at the address.
    OtherDrone,
    /// The peer did not prove that it has the secret key.
    Unproven,
    /// The peer does not trust this drone.
    Denied,
    /// The rate limit or the limit of simultaneous handshakes was exceeded.
    TooMany,
    /// The handshake failed for another reason: no key, no answer, another protocol, no such address.
    Unfinished,
}

impl Refusal {
    /// The reason of a failed connection; `None` if [`Trust`] has counted it already.
    pub(super) fn of(error: &ConnectionError) -> Option<Self> {
        let denied = TransportErrorCode::crypto(AlertDescription::AccessDenied.into());
        match error {
            ConnectionError::TransportError(own) if own.code == denied => None,
            ConnectionError::ConnectionClosed(close) if close.error_code == denied => {
                Some(Self::Denied)
            }
            _ => Some(Self::Unfinished),
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stranger => "stranger",
            Self::Revoked => "revoked",
            Self::OtherDrone => "other drone",
            Self::Unproven => "unproven",
            Self::Denied => "denied",
            Self::TooMany => "too many",
            Self::Unfinished => "unfinished",
        })
    }
}

impl From<Distrust> for Refusal {
    fn from(distrust: Distrust) -> Self {
        match distrust {
            Distrust::Stranger => Self::Stranger,
            Distrust::Revoked => Self::Revoked,
        }
    }
}

/// Failed attempts to connect, by reason.
#[derive(Debug, Default)]
pub(super) struct Refusals(Mutex<BTreeMap<Refusal, u64>>);

impl Refusals {
    pub(super) fn count(&self, refusal: Refusal) {
        *self.lock().entry(refusal).or_default() += 1;
    }

    pub(super) fn all(&self) -> BTreeMap<Refusal, u64> {
        self.lock().clone()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<Refusal, u64>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The authenticated peer of a connection, and the negotiated application protocol.
pub(super) fn authenticated_peer(
    identities: &dyn Identities,
    connection: &quinn::Connection,
) -> Option<(Peer, Vec<u8>)> {
    let handshake = connection.handshake_data()?.downcast::<HandshakeData>();
    let protocol = handshake.ok()?.protocol?;
    let shown = connection.peer_identity()?;
    let shown = shown.downcast::<Vec<CertificateDer<'static>>>().ok()?;
    let peer = identities.peer(&public_key(shown.first()?)?).ok()?;
    Some((peer, protocol))
}

/// Server name for TLS that stands for the expected drone; `None` accepts any drone of the fleet.
pub(super) fn expected_name(drone: Option<NodeId>) -> String {
    drone.map_or_else(|| "any".to_owned(), |id| format!("drone-{id}"))
}

const HAS_TLS13: &str = "the provider has TLS 1.3 and the cipher suite of QUIC's initial packets";

/// Configuration of outgoing connections.
pub(super) fn client(trust: &Arc<Trust>, protocol: &[u8]) -> quinn::ClientConfig {
    let resolver = AlwaysResolvesClientRawPublicKeys::new(trust.certified());
    let mut config = rustls::ClientConfig::builder_with_provider(trust.provider())
        .with_protocol_versions(&[&version::TLS13])
        .expect(HAS_TLS13)
        .dangerous()
        .with_custom_certificate_verifier(Arc::clone(trust) as _)
        .with_client_cert_resolver(Arc::new(resolver));
    config.alpn_protocols = vec![protocol.to_vec()];
    // The name is only for the own verifier; it is not sent.
    config.enable_sni = false;
    // Every connection is fully authenticated, so that a revoked drone can't resume one.
    config.resumption = Resumption::disabled();
    let crypto = QuicClientConfig::try_from(config).expect(HAS_TLS13);
    quinn::ClientConfig::new(Arc::new(crypto))
}

/// Configuration of incoming connections.
pub(super) fn server(trust: &Arc<Trust>, protocols: Vec<Vec<u8>>) -> quinn::ServerConfig {
    let resolver = AlwaysResolvesServerRawPublicKeys::new(trust.certified());
    let mut config = rustls::ServerConfig::builder_with_provider(trust.provider())
        .with_protocol_versions(&[&version::TLS13])
        .expect(HAS_TLS13)
        .with_client_cert_verifier(Arc::clone(trust) as _)
        .with_cert_resolver(Arc::new(resolver));
    config.alpn_protocols = protocols;
    config.session_storage = Arc::new(NoServerSessionStorage {});
    config.send_tls13_tickets = 0;
    let crypto = QuicServerConfig::try_from(config).expect(HAS_TLS13);
    quinn::ServerConfig::with_crypto(Arc::new(crypto))
}

/// Verifies peers against the trusted keys and counts refusals.
pub(super) struct Trust {
    identities: Arc<dyn Identities>,
    refusals: Arc<Refusals>,
    algorithms: WebPkiSupportedAlgorithms,
}

impl fmt::Debug for Trust {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Trust").finish_non_exhaustive()
    }
}

impl Trust {
    pub(super) fn new(identities: Arc<dyn Identities>, refusals: Arc<Refusals>) -> Arc<Self> {
        Arc::new(Self {
            identities,
            refusals,
            algorithms: ring::default_provider().signature_verification_algorithms,
        })
    }

    fn provider(&self) -> Arc<CryptoProvider> {
        Arc::new(ring::default_provider())
    }

    /// The own public key in the form that TLS needs.
    fn certified(&self) -> Arc<CertifiedKey> {
        let public = public_key_to_spki(&alg_id::ED25519, self.identities.public_key());
        let shown = vec![CertificateDer::from(public.to_vec())];
        let key = OwnKey(Arc::clone(&self.identities));
        Arc::new(CertifiedKey::new(shown, Arc::new(key)))
    }

    fn refuse(&self, refusal: Refusal) -> Error {
        self.refusals.count(refusal);
        // It becomes the alert `access_denied`, which no other error uses; see `Refusal::of`.
        Error::InvalidCertificate(CertificateError::ApplicationVerificationFailure)
    }

    fn peer(&self, shown: &CertificateDer<'_>) -> Result<Peer, Error> {
        let known = public_key(shown).ok_or(Distrust::Stranger);
        known
            .and_then(|key| self.identities.peer(&key))
            .map_err(|distrust| self.refuse(distrust.into()))
    }

    fn verify(
        &self,
        message: &[u8],
        shown: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let key = SubjectPublicKeyInfoDer::from(shown.as_ref());
        verify_tls13_signature_with_raw_key(message, &key, signed, &self.algorithms)
            .map_err(|_| self.refuse(Refusal::Unproven))
    }
}

/// The presented key; `None` if it is not Ed25519.
fn public_key(shown: &CertificateDer<'_>) -> Option<PublicKey> {
    shown.strip_prefix(&SPKI_PREFIX)?.try_into().ok()
}

const ONLY_TLS13: &str = "QUIC uses TLS 1.3 only";

/// The signature checks, which are the same in both verifiers.
macro_rules! checks_signatures {
    () => {
        fn verify_tls12_signature(
            &self,
            _message: &[u8],
            _cert: &CertificateDer<'_>,
            _dss: &DigitallySignedStruct,
        ) -> Result<HandshakeSignatureValid, Error> {
            Err(Error::General(ONLY_TLS13.to_owned()))
        }

        fn verify_tls13_signature(
            &self,
            message: &[u8],
            cert: &CertificateDer<'_>,
            dss: &DigitallySignedStruct,
        ) -> Result<HandshakeSignatureValid, Error> {
            self.verify(message, cert, dss)
        }

        fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
            vec![SignatureScheme::ED25519]
        }

        fn requires_raw_public_keys(&self) -> bool {
            true
        }
    };
}

impl ServerCertVerifier for Trust {
    fn verify_server_cert(
        &self,
        end_entity: &CertificateDer<'_>,
        _intermediates: &[CertificateDer<'_>],
        server_name: &ServerName<'_>,
        _ocsp_response: &[u8],
        _now: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        let Peer::Drone(found) = self.peer(end_entity)? else {
            return Err(self.refuse(Refusal::OtherDrone));
        };
        let name = server_name.to_str();
        if name == expected_name(None) || name == expected_name(Some(found)) {
            Ok(ServerCertVerified::assertion())
        } else {
            Err(self.refuse(Refusal::OtherDrone))
        }
    }

    checks_signatures!();
}

impl ClientCertVerifier for Trust {
    fn root_hint_subjects(&self) -> &[DistinguishedName] {
        &[]
    }

    fn verify_client_cert(
        &self,
        end_entity: &CertificateDer<'_>,
        _intermediates: &[CertificateDer<'_>],
        _now: UnixTime,
    ) -> Result<ClientCertVerified, Error> {
        self.peer(end_entity)
            .map(|_| ClientCertVerified::assertion())
    }

    checks_signatures!();
}

/// Signs with the own key, which stays in the identities.
struct OwnKey(Arc<dyn Identities>);

impl fmt::Debug for OwnKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("OwnKey(..)")
    }
}

impl SigningKey for OwnKey {
    fn choose_scheme(&self, offered: &[SignatureScheme]) -> Option<Box<dyn Signer>> {
        let is_offered = offered.contains(&SignatureScheme::ED25519);
        is_offered.then(|| Box::new(Self(Arc::clone(&self.0))) as Box<dyn Signer>)
    }

    fn public_key(&self) -> Option<SubjectPublicKeyInfoDer<'_>> {
        Some(public_key_to_spki(&alg_id::ED25519, self.0.public_key()))
    }

    fn algorithm(&self) -> SignatureAlgorithm {
        SignatureAlgorithm::ED25519
    }
}

impl Signer for OwnKey {
    fn sign(&self, message: &[u8]) -> Result<Vec<u8>, Error> {
        Ok(self.0.sign(message).to_vec())
    }

    fn scheme(&self) -> SignatureScheme {
        SignatureScheme::ED25519
    }
}
