/* Children of a fork load and query, whether the parent has loaded before or not. */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include "pegfit.h"

/* Loads, queries and closes; 0 if all is well. */
static int use(const char *path) {
    PegfitTable table;
    PegfitPose pose = {{0.004, 0, 0}, {0, 0, 0, 1}};
    PegfitResponse at;
    if (pegfit_table_load(path, 0, &table) != PEGFIT_STATUS_OK) return 1;
    if (pegfit_table_query(table, &pose, &at) != PEGFIT_STATUS_OK) return 2;
    if (!(at.coverage == 1.0 && at.force[0] < -0.1)) return 3;
    return pegfit_table_close(table) == PEGFIT_STATUS_OK ? 0 : 4;
}

/* The same in a child, which is ended if it takes forever, and in a child of that. */
static int in_a_child(const char *path, int depth) {
    pid_t child = fork();
    if (child < 0) return 5;
    if (child == 0) {
        int ended;
        alarm(120);
        ended = use(path);
        if (ended == 0 && depth > 0) ended = in_a_child(path, depth - 1);
        _exit(ended);
    }
    int status;
    if (waitpid(child, &status, 0) != child) return 6;
    if (WIFSIGNALED(status)) {
        fprintf(stderr, "a child took forever: signal %d\n", WTERMSIG(status));
        return 7;
    }
    return WEXITSTATUS(status);
}

int main(int count, char **words) {
    PegfitTable kept;
    PegfitPose pose = {{0.004, 0, 0}, {0, 0, 0, 1}};
    PegfitResponse at;
    if (count != 2) return 2;
    int before = in_a_child(words[1], 0);
    int loaded = pegfit_table_load(words[1], 0, &kept) == PEGFIT_STATUS_OK ? 0 : 8;
    int after = in_a_child(words[1], 1);
    /* What the parent loaded, a child can query. */
    pid_t child = fork();
    int status;
    if (child == 0) _exit(pegfit_table_query(kept, &pose, &at) != PEGFIT_STATUS_OK);
    if (waitpid(child, &status, 0) != child || status != 0) return 9;
    if (before || loaded || after || use(words[1])) {
        fprintf(stderr, "before %d, loaded %d, after %d\n", before, loaded, after);
        return 1;
    }
    puts("every child answered");
    return 0;
}
