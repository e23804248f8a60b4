# Grasps on a CPU, with physics and the viewer:
#   docker build -t ffhnet .
#   docker run --rm -v "$PWD:/work" ffhnet grasp scene.ply
#   docker run --rm -p 127.0.0.1:8080:8080 ffhnet view --host 0.0.0.0
FROM python:3.11-slim

WORKDIR /opt/ffhnet
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY src src
# The public index brings a torch with gigabytes of GPU libraries. Give the address of an index with CPU builds of the
# same version as TORCH_INDEX to keep them out:  docker build --build-arg TORCH_INDEX=... -t ffhnet .
ARG TORCH_INDEX=
RUN pip install --no-cache-dir -c constraints.txt ${TORCH_INDEX:+--index-url "$TORCH_INDEX"} torch \
 && pip install --no-cache-dir -c constraints.txt ".[sim,viewer]"

RUN useradd --create-home grasper
USER grasper
WORKDIR /work
EXPOSE 8080
ENTRYPOINT ["ffhnet"]
CMD ["--help"]
