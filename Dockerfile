# docker build -t roomsight .                                   (for this machine's processor)
# docker buildx build --platform linux/amd64,linux/arm64 --build-arg SOURCE_DATE_EPOCH=$(git log -1 --format=%ct) \
#     --output type=image,name=REGISTRY/roomsight,push=true,rewrite-timestamp=true .
#                                                                (for both, the same bytes each time the bases are the same)
# docker run -p 8080:8080 -e ROOMSIGHT_KEYS=... roomsight       (`roomsight key new` makes keys)
#
# Without keys the service refuses to listen on an address that others can reach. To serve everyone
# all the same, say so: -e ROOMSIGHT_ALLOW_ANONYMOUS=true
#
# Models that are uploaded stay in the volume of /opt/roomsight/models: -v rooms:/opt/roomsight/models keeps it. A
# folder of the host in its place must be readable, and for uploads writable, for the user 10001. Models from a
# bucket (-e ROOMSIGHT_MODELS=s3://BUCKET/PREFIX) are kept in the volume of /opt/roomsight/models-cache. What people teach on
# the page stays in the volume of /opt/roomsight/data.

FROM node:20-bookworm-slim AS page
WORKDIR /src/dashboard
COPY dashboard/package.json dashboard/package-lock.json ./
RUN npm ci --no-audit --no-fund
COPY dashboard .
RUN npm run build

# ONNX Runtime and the networks that `train` looks through, for the processor that the image is for.
FROM python:3.12-slim-bookworm AS networks
WORKDIR /src
COPY tools/networks.py tools/networks.txt tools/
RUN pip install --no-cache-dir numpy==2.4.6 onnx==1.23.2 blake3==1.0.11 && python tools/networks.py networks

FROM rust:1-slim-bookworm AS build
WORKDIR /src
# The dependencies alone, with nothing of ours to compile: kept until they change.
COPY Cargo.toml Cargo.lock ./
COPY crates/bench/Cargo.toml crates/bench/
COPY crates/bench/benches crates/bench/benches
COPY crates/client/Cargo.toml crates/client/
COPY crates/lab/Cargo.toml crates/lab/
COPY crates/protocol/Cargo.toml crates/protocol/
COPY crates/python/Cargo.toml crates/python/
COPY crates/recognition/Cargo.toml crates/recognition/
COPY crates/recording/Cargo.toml crates/recording/
COPY crates/vision/Cargo.toml crates/vision/
COPY benches benches
COPY build.rs ./
COPY dashboard/dist dashboard/dist
RUN mkdir src && echo 'fn main() {}' > src/main.rs && touch src/lib.rs \
    && for crate in crates/*; do mkdir "$crate/src" && touch "$crate/src/lib.rs"; done \
    && echo 'fn main() {}' > crates/bench/src/main.rs \
    && cargo build --profile dist --locked --bin roomsight && rm -r src crates/*/src
COPY . .
COPY --from=page /src/dashboard/dist/page dashboard/dist/page
# Files keep the times that they had, which may be before those of what was built of nothing.
RUN touch src/*.rs crates/*/src/lib.rs crates/lab/build.rs && cargo build --profile dist --locked --bin roomsight

FROM debian:bookworm-slim
RUN groupadd --system --gid 10001 roomsight \
    && useradd --system --uid 10001 --gid 10001 --no-create-home roomsight
# Whom to believe, where models come from a bucket.
COPY --from=build /etc/ssl/certs/ca-certificates.crt /etc/ssl/certs/
COPY --from=build /src/target/dist/roomsight /usr/local/bin/roomsight
COPY --from=networks /src/networks /usr/local/bin/networks
WORKDIR /opt/roomsight
COPY --chown=10001:10001 models models
RUN install -d -o 10001 -g 10001 models models-cache data
# As a number, so that Kubernetes sees that it is not root.
USER 10001:10001
VOLUME ["/opt/roomsight/models", "/opt/roomsight/models-cache", "/opt/roomsight/data"]
ENV ROOMSIGHT_LISTEN=0.0.0.0:8080 ROOMSIGHT_DATA=data
EXPOSE 8080
# `health` asks where the settings say, and waits for 4 s at most.
HEALTHCHECK --interval=10s --timeout=5s --start-period=10s CMD ["roomsight", "health"]
ENTRYPOINT ["roomsight"]
CMD ["serve"]
