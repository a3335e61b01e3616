# shellcheck shell=bash
# A Slurm of two nodes on this machine, for tests/slurm/run: its own munged, slurmctld and slurmd n1 and n2, under one
# folder, as the user who calls, beside any Slurm that may be there. To be sourced.

# The folder of all that the cluster writes; set by cluster_start.
cluster=

# free_ports: the first of three ports in a row on which nobody listens; not always the same, for two clusters that start at
# the same time.
free_ports() {
    local base port
    for base in $(shuf -e {17000..17900..10}); do
        for port in "$base" $((base + 1)) $((base + 2)); do
            if (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null; then
                continue 2
            fi
        done
        echo "$base"
        return
    done
    return 1
}

# cluster_start FOLDER: FOLDER must be there, and nobody else may write into it.
cluster_start() {
    cluster=$1
    local port user
    port=$(free_ports) || return
    user=$(id -un)
    export SLURM_CONF=$cluster/slurm.conf
    mkdir -p "$cluster/munge" "$cluster/state" "$cluster/spool"
    (umask 077 && head -c 128 /dev/urandom >"$cluster/munge/key")
    # SlurmdTimeout: a node that says nothing for so long is down, and one on a busy machine must not be. cred_expire: what
    # a message may take on such a machine, and also how long a requeued task has to wait. config_overrides: two cores for
    # each node, whatever there is.
    cat >"$SLURM_CONF" <<CONF
ClusterName=curvelax
SlurmctldHost=localhost
SlurmctldPort=$port
AuthType=auth/munge
AuthInfo=socket=$cluster/munge/socket,cred_expire=300
SlurmUser=$user
SlurmdUser=$user
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdParameters=config_overrides
SchedulerParameters=bf_interval=2,sched_interval=5
ReturnToService=2
SlurmdTimeout=300
MessageTimeout=100
TCPTimeout=60
KillWait=5
JobRequeue=1
MinJobAge=3600
StateSaveLocation=$cluster/state
SlurmdSpoolDir=$cluster/spool/%n
SlurmctldPidFile=$cluster/slurmctld.pid
SlurmdPidFile=$cluster/%n.pid
SlurmctldLogFile=$cluster/slurmctld.log
SlurmdLogFile=$cluster/%n.log
NodeName=n1 NodeHostname=localhost NodeAddr=127.0.0.1 Port=$((port + 1)) CPUs=2 RealMemory=2000
NodeName=n2 NodeHostname=localhost NodeAddr=127.0.0.1 Port=$((port + 2)) CPUs=2 RealMemory=2000
PartitionName=main Nodes=n1,n2 Default=YES State=UP
CONF
    munged --key-file="$cluster/munge/key" --socket="$cluster/munge/socket" --pid-file="$cluster/munge/pid" \
        --log-file="$cluster/munge/log" --seed-file="$cluster/munge/seed" --num-threads=1 || return
    slurmctld -f "$SLURM_CONF" -c || return
    node_start n1 || return
    node_start n2 || return
    for _ in {1..1200}; do
        if [ "$(sinfo -h -o '%D %T' 2>/dev/null)" = "2 idle" ]; then
            return
        fi
        sleep 0.5
    done
    return 1
}

node_start() {
    slurmd -f "$SLURM_CONF" -N "$1"
}

# processes_with FILE: those that have FILE open. slurmd and its slurmstepds have the log of their node.
processes_with() {
    local open
    for open in /proc/[0-9]*/fd/*; do
        if [ "$open" -ef "$1" ]; then
            open=${open#/proc/}
            echo "${open%%/*}"
        fi
    done | sort -nu
}

# tasks: what runs as tasks of this cluster: process, node, and index in the array, or - for one that is of none.
tasks() {
    local environment variable process node index
    # A process may end meanwhile.
    { grep -lzxF "SLURM_CONF=$SLURM_CONF" /proc/[0-9]*/environ 2>/dev/null || true; } | while read -r environment; do
        process=${environment#/proc/} node='' index=-
        while IFS= read -rd '' variable; do
            case $variable in
                SLURMD_NODENAME=*) node=${variable#*=} ;;
                SLURM_ARRAY_TASK_ID=*) index=${variable#*=} ;;
            esac
        done 2>/dev/null <"$environment" || true
        if [ -n "$node" ]; then
            echo "${process%/*} $node $index"
        fi
    done
}

# kill_all COMMAND: kills the processes that COMMAND names until it names none. Ten minutes are for none that can be killed.
kill_all() {
    local all
    for _ in {1..6000}; do
        all=$("$@")
        if [ -z "$all" ]; then
            return
        fi
        # shellcheck disable=SC2086 # A word for each process.
        kill -KILL $all 2>/dev/null || true
        sleep 0.1
    done
    echo "what does not die ($*):" "$all" >&2
    return 1
}

node_processes() {
    processes_with "$cluster/$1.log"
    tasks | awk -v node="$1" '$2 == node { print $1 }'
}

# node_kill NODE: the power is cut: slurmd, its slurmstepds and all their tasks.
node_kill() {
    kill_all node_processes "$1"
}

# cluster_stop: ends everything that cluster_start and its jobs began.
cluster_stop() {
    if [ -n "$cluster" ]; then
        # The controller first, or it would start the tasks again.
        kill_all processes_with "$cluster/slurmctld.log"
        node_kill n1
        node_kill n2
        kill_all processes_with "$cluster/munge/log"
    fi
}
