#!/bin/sh
# The guest's first and only program: the host's files, read-only; one command in them; its exit status; off.
# Kernel messages go to the first serial line (a file), what the command says to the second.
. /settings # KEPT, TIME_LIMIT_S, MARK

mount -t proc proc /proc
mount -t devtmpfs dev /dev
exec >/dev/ttyS1 2>&1 </dev/null
stty -F /dev/ttyS1 raw

off() {
    echo "$MARK $1"
    sync
    poweroff -f
}

for module in $(cat /modules/order); do
    insmod "/modules/$module" || off "no-module-$module"
done
mount -t 9p -o trans=virtio,version=9p2000.L,ro,cache=loose,msize=1048576 host /host || off no-9p

# Folders that the command needs and that lie below /tmp, which becomes a new and writable one.
n=0
for folder in $KEPT; do
    n=$((n + 1))
    mkdir -p "/kept/$n"
    mount --bind "/host$folder" "/kept/$n" || off "no-$folder"
done
mount -t tmpfs -o mode=1777 tmp /host/tmp
n=0
for folder in $KEPT; do
    n=$((n + 1))
    mkdir -p "/host$folder"
    mount --move "/kept/$n" "/host$folder"
done

mount -t proc proc /host/proc
mount -t sysfs sys /host/sys
mount -t devtmpfs dev /host/dev
mkdir -p /host/dev/pts /host/dev/shm
mount -t devpts devpts /host/dev/pts
mount -t tmpfs shm /host/dev/shm
ln -sf /proc/self/fd /host/dev/fd
ifconfig lo 127.0.0.1 up

cp /command /host/tmp/command
began=$(cut -d. -f1 /proc/uptime)
timeout -k 5 "$TIME_LIMIT_S" chroot /host /bin/sh /tmp/command
status=$?
[ $(($(cut -d. -f1 /proc/uptime) - began)) -lt "$TIME_LIMIT_S" ] || off "its command took $TIME_LIMIT_S s"
off $status
