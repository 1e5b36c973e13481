/* What a C program can do wrong without lying about its memory: each gets its own status. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "pegfit.h"

#define EXPECT(call, wanted)                                                                       \
    do {                                                                                           \
        PegfitStatus found = (call);                                                               \
        if (found != (wanted)) {                                                                   \
            fprintf(stderr, "line %d: %s: %s\n", __LINE__, #call, pegfit_status_message(found));   \
            return 1;                                                                              \
        }                                                                                          \
    } while (0)

int main(int count, char **words) {
    if (count != 2) return 2;
    PegfitTable table = 77;
    PegfitPose pose = {{0, 0, 0}, {0, 0, 0, 1}};
    PegfitResponse at;
    PegfitTableInfo info;
    char text[32];

    EXPECT(pegfit_table_load(NULL, 0, &table), PEGFIT_STATUS_BAD_POINTER);
    if (table != 0) return 1;
    EXPECT(pegfit_table_load(words[1], 0, NULL), PEGFIT_STATUS_BAD_POINTER);
    EXPECT(pegfit_table_load("/no/such/table", 0, &table), PEGFIT_STATUS_CANNOT_LOAD);
    EXPECT(pegfit_table_load("\xff", 0, &table), PEGFIT_STATUS_BAD_PATH);
    EXPECT(pegfit_table_load(words[1], 10, &table), PEGFIT_STATUS_CANNOT_LOAD);
    EXPECT(pegfit_table_load(words[1], 0, &table), PEGFIT_STATUS_OK);

    EXPECT(pegfit_table_query(table, NULL, &at), PEGFIT_STATUS_BAD_POINTER);
    EXPECT(pegfit_table_query(table, &pose, NULL), PEGFIT_STATUS_BAD_POINTER);
    EXPECT(pegfit_table_info(table, NULL), PEGFIT_STATUS_BAD_POINTER);
    EXPECT(pegfit_table_query_many(table, NULL, NULL, 0), PEGFIT_STATUS_OK);
    EXPECT(pegfit_table_query_many(table, NULL, &at, 1), PEGFIT_STATUS_BAD_POINTER);
    EXPECT(pegfit_table_query_many(table, &pose, &at, (size_t)-1), PEGFIT_STATUS_BAD_SIZE);
    EXPECT(pegfit_table_query_many(table, &pose, (PegfitResponse *)&pose, 1),
           PEGFIT_STATUS_BAD_POINTER);

    pose.translation[1] = NAN;
    EXPECT(pegfit_table_query(table, &pose, &at), PEGFIT_STATUS_BAD_POSE);
    pose.translation[1] = 0;
    pose.rotation[3] = 2;
    EXPECT(pegfit_table_query(table, &pose, &at), PEGFIT_STATUS_BAD_POSE);
    if (pegfit_last_error(NULL, 0) <= sizeof text) return 1;
    pegfit_last_error(text, sizeof text);
    if (strlen(text) != sizeof text - 1 || strncmp(text, "pose 0: ", 8) != 0) return 1;
    pose.rotation[3] = 1;

    EXPECT(pegfit_table_query(table, &pose, &at), PEGFIT_STATUS_OK);
    EXPECT(pegfit_table_close(table), PEGFIT_STATUS_OK);
    EXPECT(pegfit_table_close(table), PEGFIT_STATUS_NO_SUCH_TABLE);
    EXPECT(pegfit_table_query(table, &pose, &at), PEGFIT_STATUS_NO_SUCH_TABLE);
    EXPECT(pegfit_table_info(table, &info), PEGFIT_STATUS_NO_SUCH_TABLE);
    EXPECT(pegfit_table_close(0), PEGFIT_STATUS_NO_SUCH_TABLE);
    EXPECT(pegfit_table_close(~(PegfitTable)0), PEGFIT_STATUS_NO_SUCH_TABLE);
    puts("every misuse was refused");
    return 0;
}
