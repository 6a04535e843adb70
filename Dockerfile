# fusetune with all that it needs, in the locked versions and with the estimator compiled: docs/install.md.
#
#   docker build --tag fusetune .
#   docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/work" fusetune run
ARG PYTHON=python:3.11-slim

FROM ${PYTHON} AS built
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PATH=/opt/fusetune/bin:$PATH
RUN python -m venv /opt/fusetune
WORKDIR /sources
# what changes seldom goes first, so that a changed source leaves it as it is
COPY requirements.lock ./
RUN pip install --no-deps --require-hashes -r requirements.lock
COPY pyproject.toml setup.py MANIFEST.in README.md LICENSE ./
COPY src src
COPY workflow workflow
COPY config config
# the wheel carries the estimator compiled for all processors with AVX2, if it is made on such a one
RUN FUSETUNE_KERNELS=$([ "$(uname -m)" = x86_64 ] && grep -q avx2 /proc/cpuinfo && echo 1) \
    pip wheel --no-deps --no-build-isolation --no-index --wheel-dir /wheels . \
    && pip install --no-deps --no-index /wheels/*.whl

FROM ${PYTHON}
LABEL org.opencontainers.image.title="fusetune" \
      org.opencontainers.image.description="Choose PX4 EKF2 parameters from flight logs, without ground truth" \
      org.opencontainers.image.licenses="BSD-3-Clause"
COPY --from=built /opt/fusetune /opt/fusetune
# Whoever `--user` names has a place for caches.
ENV PATH=/opt/fusetune/bin:$PATH HOME=/tmp
RUN useradd --uid 1000 --no-create-home --home-dir /tmp fusetune
USER fusetune
# A folder of the host with `flights/` in it; results and state are written beside that.
VOLUME /work
WORKDIR /work
ENTRYPOINT ["fusetune"]
CMD ["--help"]
