"""A Dask cluster of two processes, the user's in real life: prints its address, then kills a worker when told to."""

import os
import signal
import sys

import distributed

if __name__ == "__main__":
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        for line in sys.stdin:
            if line.strip() == "kill":
                with distributed.Client(cluster, set_as_default=False) as client:
                    victim = next(iter(client.run(os.getpid).values()))
                os.kill(victim, signal.SIGKILL)
                print(victim, flush=True)
            else:
                break
