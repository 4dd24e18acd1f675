#!/usr/bin/env bash
# Makes the certificates of the tests anew: an authority, two certificates of the service, one of a caller.
# They protect nothing: their keys lie beside them.
set -euo pipefail
cd "$(dirname "$0")"
days=36500
key() { openssl ecparam -name prime256v1 -genkey -noout | openssl pkcs8 -topk8 -nocrypt; }
sign() { # name, subject alternative names, use
    key > "$1.key"
    openssl req -new -key "$1.key" -subj "/CN=$1" |
        openssl x509 -req -days "$days" -CA ca.pem -CAkey ca.key -set_serial "0x$(openssl rand -hex 8)" -extfile <(
            printf 'basicConstraints=CA:FALSE\nkeyUsage=digitalSignature\nextendedKeyUsage=%s\n%s' "$3" "$2"
        ) > "$1.pem"
}
key > ca.key
openssl req -x509 -new -key ca.key -days "$days" -subj /CN=roomsight-tests \
    -addext basicConstraints=critical,CA:TRUE -addext keyUsage=critical,keyCertSign > ca.pem
sign service 'subjectAltName=DNS:localhost,IP:127.0.0.1' serverAuth
sign renewed 'subjectAltName=DNS:localhost,IP:127.0.0.1' serverAuth
sign caller 'subjectAltName=DNS:wall-e' clientAuth
rm ca.key
