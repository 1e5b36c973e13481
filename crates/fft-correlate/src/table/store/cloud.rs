//! Object stores by URL: `s3://`, `gs://`, `http://`, `https://` (WebDAV).
//!
//! Credentials and endpoints come from the environment, by the names that each vendor's tools read
//! (`AWS_ACCESS_KEY_ID`, `AWS_ENDPOINT`, `GOOGLE_SERVICE_ACCOUNT`, ...); see the documentation of
//! `object_store`.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use object_store::prefix::PrefixStore;
use tokio::runtime::{Builder, Handle, Runtime};
use zarrs_object_store::AsyncObjectStore;
use zarrs_storage::storage_adapter::async_to_sync::{
    AsyncToSyncBlockOn, AsyncToSyncStorageAdapter,
};

use crate::table::store::Backend;
use crate::table::store::error::StoreError;

/// How the names of settings in the environment begin, in lower case.
const PREFIXES: [&str; 2] = ["aws_", "google_"];

/// Waits for requests on the calling thread; a thread of the runtime serves the network.
struct BlockingRuntime(Handle);

impl AsyncToSyncBlockOn for BlockingRuntime {
    fn block_on<F: Future>(&self, future: F) -> F::Output {
        self.0.block_on(future)
    }
}

/// One runtime for all stores, made when the first is asked for.
fn runtime() -> std::io::Result<Handle> {
    static RUNTIME: OnceLock<Runtime> = OnceLock::new();
    if let Some(runtime) = RUNTIME.get() {
        return Ok(runtime.handle().clone());
    }
    let made = Builder::new_multi_thread()
        .worker_threads(1)
        .thread_name("object-store")
        .enable_all()
        .build()?;
    Ok(RUNTIME.get_or_init(|| made).handle().clone())
}

/// The store of a URL, its path being the folder of the table.
pub(super) fn connect(place: &Path) -> Result<Arc<Backend>, StoreError> {
    let fail = |reason: String| StoreError::Url {
        url: place.into(),
        reason,
    };
    // The store's client needs a provider of ciphers; one that is already chosen stays.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let text = place.to_str().unwrap_or_default();
    let url = url::Url::parse(text).map_err(|e| fail(e.to_string()))?;
    let environment = std::env::vars_os().filter_map(|(name, value)| {
        let name = name.into_string().ok()?.to_lowercase();
        Some((name, value.into_string().ok()?))
    });
    let settings = environment.filter(|(name, _)| PREFIXES.iter().any(|p| name.starts_with(p)));
    // Whoever writes http:// means it.
    let plain = (url.scheme() == "http").then(|| ("allow_http".into(), "true".into()));
    let (store, folder) = object_store::parse_url_opts(&url, settings.chain(plain))
        .map_err(|e| fail(e.to_string()))?;
    let store = AsyncObjectStore::new(PrefixStore::new(store, folder));
    let handle = runtime().map_err(|e| fail(e.to_string()))?;
    Ok(Arc::new(AsyncToSyncStorageAdapter::new(
        Arc::new(store),
        BlockingRuntime(handle),
    )))
}
