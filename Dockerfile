# What the README's two commands need, and nothing of ranger-sim: docker build -t ranger-sim . &&
# docker run --rm -v "$PWD":/ranger-sim -w /ranger-sim ranger-sim make walk
FROM python:3.11-bookworm
RUN apt-get update && apt-get install -y --no-install-recommends \
      build-essential make git chromium gcc-arm-none-eabi libnewlib-arm-none-eabi gdb-multiarch \
    && rm -rf /var/lib/apt/lists/*
