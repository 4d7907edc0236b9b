# Shared by the scripts that test in a chroot of another Debian; sourced, from the root of the repository. Needs root.
# The caller sets chroot_dir, and copy, the place of the working tree in it, as seen from inside.

mirror=${DEBIAN_MIRROR:-} # empty: the one that debootstrap knows
mounted=()

require_root() {
  if [ "$(id -u)" -ne 0 ]; then
    echo "${0##*/}: a chroot needs root; run: sudo $0" >&2
    exit 2
  fi
}

make_chroot() { # SUITE [PACKAGES,...]
  if [ ! -x "$chroot_dir/usr/bin/apt-get" ]; then
    command -v debootstrap >/dev/null || { apt-get update -q && apt-get install -qy --no-install-recommends debootstrap; }
    debootstrap --variant=minbase ${2:+--include="$2"} "$1" "$chroot_dir" ${mirror:+"$mirror"}
  fi
  mkdir -p "$chroot_dir/proc" "$chroot_dir/sys" "$chroot_dir/dev/shm"
  # The network is that of the host: its names, its certificates, its settings of pip.
  cp -L /etc/resolv.conf "$chroot_dir/etc/resolv.conf"
  certificates="" # beside those of the chroot, whose package would replace them
  if [ -f /etc/ssl/certs/ca-certificates.crt ]; then
    certificates=/etc/host-certificates.crt
    cp -L /etc/ssl/certs/ca-certificates.crt "$chroot_dir$certificates"
  fi
  trap '[ "${#mounted[@]}" -eq 0 ] || umount "${mounted[@]}"' EXIT
  mount_once proc proc
  mount_once sysfs sys ro # MPI looks for cores there
  mount_once tmpfs dev/shm mode=1777
}

mount_once() { # TYPE PLACE [OPTIONS]
  mountpoint -q "$chroot_dir/$2" && return
  mount -t "$1" ${3:+-o "$3"} "$1" "$chroot_dir/$2"
  mounted=("$chroot_dir/$2" "${mounted[@]}")
}

copy_tree() { # a copy of the working tree, so that nothing of the chroot is left in it; its .venv is kept there
  mkdir -p "$chroot_dir$copy"
  find "$chroot_dir$copy" -mindepth 1 -maxdepth 1 ! -name .venv -exec rm -rf {} +
  git ls-files -z --cached --others --exclude-standard | xargs -0 sh -c 'for f; do [ ! -e "$f" ] || echo "$f"; done' sh |
    tar -c -T - | tar -x -C "$chroot_dir$copy"
}

inside() { # USER HOME COMMAND, in the copy of the working tree
  chroot --userspec="$1" "$chroot_dir" env -i HOME="$2" LANG=C.UTF-8 PATH=/usr/sbin:/usr/bin:/sbin:/bin \
    DEBIAN_FRONTEND=noninteractive XDG_CACHE_HOME="$copy/build/cache" ${certificates:+PIP_CERT="$certificates"} \
    ${PIP_INDEX_URL:+PIP_INDEX_URL="$PIP_INDEX_URL"} PYTEST_ADDOPTS="-rfEs --durations=10" bash -c "cd $copy; $3"
}
