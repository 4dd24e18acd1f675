# docker build -t roomsight .
# docker run -p 8080:8080 -e ROOMSIGHT_KEYS=... roomsight       (`roomsight key new` makes keys)
#
# Without keys the service refuses to listen on an address that others can reach. To serve everyone
# all the same, say so: -e ROOMSIGHT_ALLOW_ANONYMOUS=true

FROM rust:1-slim-bookworm AS build
WORKDIR /src
COPY . .
RUN cargo build --profile dist --locked --bin roomsight

FROM debian:bookworm-slim
RUN useradd --system --uid 10001 --no-create-home roomsight
# Whom to believe, where models come from a bucket.
COPY --from=build /etc/ssl/certs/ca-certificates.crt /etc/ssl/certs/
COPY --from=build /src/target/dist/roomsight /usr/local/bin/roomsight
COPY models /opt/roomsight/models
WORKDIR /opt/roomsight
USER roomsight
ENV ROOMSIGHT_LISTEN=0.0.0.0:8080
EXPOSE 8080
HEALTHCHECK --interval=10s --timeout=3s --start-period=10s CMD ["roomsight", "health"]
ENTRYPOINT ["roomsight"]
CMD ["serve"]
