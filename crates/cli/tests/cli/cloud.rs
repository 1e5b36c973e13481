//! Tables in an object store, through a small S3 server on this machine.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Output;
use std::sync::{Arc, Mutex};

use crate::bake::{BALL, content};
use crate::common::{scene_folder, stderr, succeed};

const URL: &str = "s3://bucket/some/t.zarr";

/// Objects by `bucket/key`.
type Objects = Arc<Mutex<BTreeMap<String, Vec<u8>>>>;

/// Serves GET, HEAD, PUT and listings of one page until the process ends; checks no signatures.
fn serve() -> (String, Objects) {
    let objects = Objects::default();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let served = objects.clone();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let objects = served.clone();
            std::thread::spawn(move || {
                // A client that hangs up early is no concern of the server.
                let _ = stream.and_then(|s| answer(s, &objects));
            });
        }
    });
    (address, objects)
}

/// Answers one request and closes the connection.
fn answer(mut stream: TcpStream, objects: &Objects) -> std::io::Result<()> {
    let mut input = BufReader::new(stream.try_clone()?);
    let mut line = String::new();
    input.read_line(&mut line)?;
    let mut words = line.split_whitespace();
    let (method, target) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
    let mut headers = BTreeMap::new();
    loop {
        let mut header = String::new();
        input.read_line(&mut header)?;
        let Some((name, value)) = header.trim().split_once(':') else {
            break;
        };
        headers.insert(name.to_lowercase(), value.trim().to_owned());
    }
    let length = headers
        .get("content-length")
        .map_or(0, |n| n.parse().unwrap());
    let mut body = vec![0; length];
    input.read_exact(&mut body)?;
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let key = path.trim_start_matches('/').to_owned();
    let mut objects = objects.lock().unwrap();
    let (status, extra, body) = match method {
        "PUT" => {
            objects.insert(key, body);
            ("200 OK", "ETag: \"1\"\r\n".to_owned(), Vec::new())
        }
        "GET" if query.contains("list-type") => {
            ("200 OK", String::new(), list(&key, query, &objects))
        }
        "GET" | "HEAD" => match objects.get(&key) {
            None => ("404 Not Found", String::new(), Vec::new()),
            Some(object) => part(object, headers.get("range").map(String::as_str)),
        },
        _ => ("501 Not Implemented", String::new(), Vec::new()),
    };
    let length = body.len();
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Length: {length}\r\nLast-Modified: Sat, 21 Nov 2026 00:00:00 GMT\
         \r\n{extra}Connection: close\r\n\r\n"
    )?;
    if method != "HEAD" {
        stream.write_all(&body)?;
    }
    Ok(())
}

/// All of an object, or the range `bytes=first-last`.
fn part(object: &[u8], range: Option<&str>) -> (&'static str, String, Vec<u8>) {
    let tag = "ETag: \"1\"\r\n";
    let bounds = range.and_then(|r| r.strip_prefix("bytes=")?.split_once('-'));
    let Some((first, last)) = bounds else {
        return ("200 OK", tag.into(), object.to_vec());
    };
    let first: usize = first.parse().unwrap();
    let last = last.parse().unwrap_or(object.len()).min(object.len() - 1);
    let range = format!(
        "{tag}Content-Range: bytes {first}-{last}/{}\r\n",
        object.len()
    );
    ("206 Partial Content", range, object[first..=last].to_vec())
}

fn list(bucket: &str, query: &str, objects: &BTreeMap<String, Vec<u8>>) -> Vec<u8> {
    let prefix = query.split('&').find_map(|q| q.strip_prefix("prefix="));
    let prefix = format!("{bucket}/{}", prefix.unwrap_or("").replace("%2F", "/"));
    let mut text = "<?xml version=\"1.0\"?><ListBucketResult>".to_owned();
    for (key, object) in objects.iter().filter(|(k, _)| k.starts_with(&prefix)) {
        text += &format!(
            "<Contents><Key>{}</Key><LastModified>2026-11-21T00:00:00.000Z</LastModified>\
             <ETag>\"1\"</ETag><Size>{}</Size></Contents>",
            &key[bucket.len() + 1..],
            object.len()
        );
    }
    (text + "<IsTruncated>false</IsTruncated></ListBucketResult>").into_bytes()
}

fn pegfit(folder: &Path, endpoint: &str, args: &[&str]) -> Output {
    std::process::Command::new(env!("CARGO_BIN_EXE_pegfit"))
        .current_dir(folder)
        .envs([
            ("AWS_ENDPOINT", endpoint),
            ("AWS_ALLOW_HTTP", "true"),
            ("AWS_ACCESS_KEY_ID", "a"),
            ("AWS_SECRET_ACCESS_KEY", "b"),
            ("AWS_REGION", "here"),
        ])
        .args(args)
        .output()
        .unwrap()
}

#[test]
fn a_table_in_an_object_store_is_that_on_disk() {
    let folder = scene_folder(BALL);
    let root = folder.path();
    succeed(root, &["bake", "scene.toml", "-o", "t.zarr", "-q"]);
    let expected: BTreeMap<String, Vec<u8>> = content(&root.join("t.zarr")).into_iter().collect();
    let (endpoint, objects) = serve();
    let run = |args: &[&str]| {
        let output = pegfit(root, &endpoint, args);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    };
    let stored = || -> BTreeMap<String, Vec<u8>> {
        let objects = objects.lock().unwrap();
        let key = |k: &str| k.strip_prefix("bucket/some/t.zarr/").unwrap().to_owned();
        objects.iter().map(|(k, v)| (key(k), v.clone())).collect()
    };
    run(&["bake", "scene.toml", "-o", URL, "-q"]);
    assert!(stored() == expected);

    // Lost and damaged objects are found and baked again.
    {
        let mut objects = objects.lock().unwrap();
        objects
            .remove("bucket/some/t.zarr/coefficients/c.1.0.0.0")
            .unwrap();
        objects
            .get_mut("bucket/some/t.zarr/coefficients/c.2.0.0.0")
            .unwrap()[9] ^= 1;
    }
    let status = ["bake", "scene.toml", "-o", URL, "--status", "--json"];
    let status: serde_json::Value = serde_json::from_str(&run(&status)).unwrap();
    assert_eq!(
        (&status["missing"], &status["damaged"]),
        (&1.into(), &1.into())
    );
    run(&["bake", "scene.toml", "-o", URL, "--resume", "-q"]);
    assert!(stored() == expected);

    std::fs::write(root.join("in.csv"), "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n").unwrap();
    let score = |table| run(&["score", "--table", table, "--poses", "in.csv", "-q"]);
    assert_eq!(score(URL), score("t.zarr"));
    run(&["verify", URL, "--scene", "scene.toml", "-q"]);
}

#[test]
fn a_store_that_does_not_answer_is_named() {
    let folder = scene_folder(BALL);
    // Nothing listens there once the listener is gone.
    let free = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let args = ["table", "http://ADDRESS/t.zarr"].map(|a| a.replace("ADDRESS", &free.to_string()));
    let output = pegfit(folder.path(), "", &[&args[0], &args[1]]);
    assert_ne!(output.status.code(), Some(0));
    assert!(
        stderr(&output)
            .replace(['\n', ' ', '│'], "")
            .contains(&args[1]),
        "{}",
        stderr(&output)
    );
}
