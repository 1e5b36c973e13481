//! Object stores by URL: `s3://`, `gs://`, `http://`, `https://` (WebDAV).
//!
//! Credentials and endpoints come from the environment, by the names that each vendor's tools read
//! (`AWS_ACCESS_KEY_ID`, `AWS_ENDPOINT`, `GOOGLE_SERVICE_ACCOUNT`, ...); see the documentation of
//! `object_store`.

use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::{Arc, OnceLock};

use object_store::path::Path as Key;
use object_store::prefix::PrefixStore;
use object_store::{ObjectStore, ObjectStoreExt};
use sdf_grid::regular::RegularError;
use tokio::runtime::{Builder, Handle, Runtime};

use crate::table::store::error::StoreError;
use crate::table::store::storage::Storage;

/// How the names of settings in the environment begin, in lower case.
const PREFIXES: [&str; 2] = ["aws_", "google_"];

/// A folder of an object store. Requests wait on the calling thread; a thread of the runtime serves
/// the network.
struct Bucket {
    store: PrefixStore<Box<dyn ObjectStore>>,
    runtime: Handle,
}

impl Storage for Bucket {
    fn size(&self, key: &str) -> io::Result<Option<u64>> {
        let head = self.runtime.block_on(self.store.head(&Key::from(key)));
        found(head.map(|object| object.size))
    }

    fn read(&self, key: &str, limit: u64) -> Result<Option<Vec<u8>>, RegularError> {
        self.runtime.block_on(async {
            let Some(object) = found(self.store.get(&Key::from(key)).await)? else {
                return Ok(None);
            };
            let found = object.meta.size;
            if found > limit {
                return Err(RegularError::Length { limit, found });
            }
            let bytes = object.bytes().await.map_err(io::Error::from)?;
            Ok(Some(bytes.into()))
        })
    }

    fn write(&self, key: &str, bytes: Vec<u8>) -> io::Result<()> {
        let key = Key::from(key);
        self.runtime.block_on(self.store.put(&key, bytes.into()))?;
        Ok(())
    }

    fn list(&self, prefix: &str) -> io::Result<Vec<(String, u64)>> {
        let mut files = Vec::new();
        let mut folders = vec![Key::from(prefix)];
        while let Some(folder) = folders.pop() {
            let listed = self.store.list_with_delimiter(Some(&folder));
            let listed = self.runtime.block_on(listed)?;
            folders.extend(listed.common_prefixes);
            let objects = listed.objects.into_iter();
            files.extend(objects.map(|object| (object.location.to_string(), object.size)));
        }
        files.sort_unstable();
        Ok(files)
    }
}

/// `None` if there is no such object.
fn found<T>(result: object_store::Result<T>) -> io::Result<Option<T>> {
    match result.map_err(io::Error::from) {
        Ok(value) => Ok(Some(value)),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
        Err(e) => Err(e),
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
pub(super) fn connect(place: &Path) -> Result<Arc<dyn Storage>, StoreError> {
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
    Ok(Arc::new(Bucket {
        store: PrefixStore::new(store, folder),
        runtime: runtime().map_err(|e| fail(e.to_string()))?,
    }))
}
