/* Loads a table and prints energy, torque and force along a line through the assembled pose.
 *
 *   cc -Iinclude examples/query.c -L../../target/release -lpegfit_c -lm -o query
 *   ./query TABLE.zarr
 */
#include <stdio.h>

#include "pegfit.h"

static int failed(const char *what) {
    char text[512];
    pegfit_last_error(text, sizeof text);
    fprintf(stderr, "%s: %s\n", what, text);
    return 1;
}

int main(int count, char **words) {
    if (count != 2) {
        fprintf(stderr, "usage: query TABLE.zarr\n");
        return 2;
    }
    PegfitTable table;
    if (pegfit_table_load(words[1], 0, &table) != PEGFIT_STATUS_OK)
        return failed("load");

    PegfitTableInfo info;
    if (pegfit_table_info(table, &info) != PEGFIT_STATUS_OK)
        return failed("info");
    printf("pegfit %s: %llu rotations, %llu bytes\n", pegfit_version(),
           (unsigned long long)info.rotations, (unsigned long long)info.bytes);

    enum { STEPS = 5 };
    for (int k = 0; k < STEPS; k++) {
        PegfitPose pose = {{0, 0, 0}, {0, 0, 0, 1}};
        double share = (k + 1.0) / (STEPS + 1.0);
        pose.translation[2] = info.window_min[2] + share * (info.window_max[2] - info.window_min[2]);
        PegfitResponse at;
        if (pegfit_table_query(table, &pose, &at) != PEGFIT_STATUS_OK)
            return failed("query");
        printf("z %+.4f m  energy %+.6f J  force %+.4f N  coverage %.2f\n", pose.translation[2],
               at.energy, at.force[2], at.coverage);
    }
    return pegfit_table_close(table) == PEGFIT_STATUS_OK ? 0 : failed("close");
}
