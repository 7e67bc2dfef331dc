//! TLS with the keys that drones have anyway: raw public keys (RFC 7250), no certificates. Both ends prove to have theirs.

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

/// What an Ed25519 key's `SubjectPublicKeyInfo` begins with (RFC 8410, section 4).
const SPKI_PREFIX: [u8; 12] = [
    0x30, 0x2a, 0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70, 0x03, 0x21, 0x00,
];

/// The application protocol of an operator's connection.
pub(super) const OPERATOR: &[u8] = b"muster-operator/1";

/// The application protocol of connections between drones of a swarm: those of another don't speak it.
pub(super) fn swarm_protocol(swarm: SwarmId) -> Vec<u8> {
    format!("muster-swarm/1/{}", swarm.0).into_bytes()
}

/// Why there was no connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Refusal {
    /// The other end's key is nobody's of the fleet.
    Stranger,
    /// It is the key of a drone that was expelled.
    RevocationList,
    /// It is not the key of the drone that was to be found there.
    OtherDrone,
    /// The other end showed a key and did not prove that it has it.
    Unproven,
    /// The other end does not believe this one.
    Denied,
    /// The other end's address has used up what it may ask for, or too many asked at once.
    TooMany,
    /// The handshake was not finished, for whatever other reason: no key, no word, another protocol, no such address.
    Unfinished,
}

impl Refusal {
    /// Why there is no connection, unless [`Trust`] has counted that already.
    pub(super) fn of(error: &ConnectionError) -> Option<Self> {
        let denied = TransportErrorCode::crypto(AlertDescription::AccessDenied.into());
        match error {
            ConnectionError::TransportError(own) if own.code == denied => None,
            ConnectionError::ConnectionClosed(said) if said.error_code == denied => {
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
            Self::RevocationList => "revoked",
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
            Distrust::RevocationList => Self::RevocationList,
        }
    }
}

/// How often there was no connection, by reason.
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

/// Whom a connection's other end has proved to be, and the application protocol that both speak.
pub(super) fn proved(
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

/// What a drone must be told to find at an address: a drone, or whichever is there.
pub(super) fn expected_name(drone: Option<NodeId>) -> String {
    drone.map_or_else(|| "any".to_owned(), |id| format!("drone-{id}"))
}

const HAS_TLS13: &str = "the provider has TLS 1.3 and the cipher suite of QUIC's first packets";

/// How connections are opened.
pub(super) fn client(trust: &Arc<Trust>, protocol: &[u8]) -> quinn::ClientConfig {
    let resolver = AlwaysResolvesClientRawPublicKeys::new(trust.certified());
    let mut config = rustls::ClientConfig::builder_with_provider(trust.provider())
        .with_protocol_versions(&[&version::TLS13])
        .expect(HAS_TLS13)
        .dangerous()
        .with_custom_certificate_verifier(Arc::clone(trust) as _)
        .with_client_cert_resolver(Arc::new(resolver));
    config.alpn_protocols = vec![protocol.to_vec()];
    // A name is what is expected there, and nobody else's business.
    config.enable_sni = false;
    // Each connection is proved anew, so that whoever was expelled meanwhile has none.
    config.resumption = Resumption::disabled();
    let crypto = QuicClientConfig::try_from(config).expect(HAS_TLS13);
    quinn::ClientConfig::new(Arc::new(crypto))
}

/// How connections are taken.
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

/// Who this end is, whom it believes, and how often it did not.
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

    /// The own key as TLS shows it.
    fn certified(&self) -> Arc<CertifiedKey> {
        let public = public_key_to_spki(&alg_id::ED25519, self.identities.public_key());
        let shown = vec![CertificateDer::from(public.to_vec())];
        let key = OwnKey(Arc::clone(&self.identities));
        Arc::new(CertifiedKey::new(shown, Arc::new(key)))
    }

    fn refuse(&self, refusal: Refusal) -> Error {
        self.refusals.count(refusal);
        // As an alert it is `access_denied`, which nothing else is; see `Refusal::of`.
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

/// The key that is shown, if it is one of Ed25519.
fn public_key(shown: &CertificateDer<'_>) -> Option<PublicKey> {
    shown.strip_prefix(&SPKI_PREFIX)?.try_into().ok()
}

const ONLY_TLS13: &str = "TLS 1.3 is all that QUIC speaks";

/// What both ends' verifiers have to say of signatures, which is the same.
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

/// The own key, which stays with whoever has the identities.
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
