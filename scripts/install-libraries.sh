#!/usr/bin/env bash
# Install what Insitu needs from the system on Debian and its kin: OpenGL, EGL and X libraries, a software rasterizer,
# Xvfb for the window test, and the venv module. Installs only what is missing, and only where it may; never fails.
set -u

packages=(libegl1 libgl1 libgl1-mesa-dri libx11-6 libxcursor1 libxi6 libxinerama1 libxrandr2 xvfb)

python3 -c 'import ensurepip, venv' 2>/dev/null || packages+=(python3-venv)

if ! command -v dpkg-query >/dev/null; then
  command -v ldconfig >/dev/null && ldconfig -p 2>/dev/null | grep -q 'libEGL\.so\.1' && exit 0
  [ "$(uname -s)" = Linux ] && echo "setup: if the window does not open, install OpenGL, EGL and Mesa's drivers with the system's package manager"
  exit 0
fi

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0

if [ "$(id -u)" -eq 0 ]; then
  as_root=()
elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
  as_root=(sudo -n)
else
  echo "setup: going on without ${missing[*]}; install them with: sudo apt-get install ${missing[*]}"
  exit 0
fi

install_missing() {
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq update </dev/null \
    && "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends "${missing[@]}" </dev/null
}
echo "setup: installing ${missing[*]}"
install_missing >/dev/null || echo "setup: could not install ${missing[*]}; going on without"
exit 0
