/* Runs the kernel on the vectors that arm_kernel.py writes; see there. */

#include <stdio.h>

#include "../src/ssiam/motion/_kernel.c"

static void *read_items(size_t size, size_t count)
{
    void *items = malloc(size * count + 1);
    if (items == NULL || fread(items, size, count, stdin) != count)
        exit(1);
    return items;
}

static void *new_items(size_t size, size_t count)
{
    void *items = calloc(count + 1, size);
    if (items == NULL)
        exit(1);
    return items;
}

static void write_items(const void *items, size_t size, size_t count)
{
    if (fwrite(items, size, count, stdout) != count)
        exit(1);
}

static Template new_template(int samples, int cells)
{
    Template made = {new_items(1, samples), new_items(2, samples), new_items(2, samples),
                     new_items(4, 2 * cells), new_items(4, 3 * cells), new_items(4, cells)};
    return made;
}

int main(void)
{
    int32_t *sizes = read_items(4, 9); /* frame, fine, coarse, tiny; whether halfway */
    Reduction to = {sizes[0], sizes[1], 3, sizes[8], sizes[2], sizes[3], sizes[4], sizes[5],
                    sizes[6], sizes[7], NULL, NULL, NULL, NULL, NULL, NULL};
    to.left = read_items(4, to.fine_width), to.right_weight = read_items(4, to.fine_width);
    to.top = read_items(4, to.fine_height), to.bottom_weight = read_items(4, to.fine_height);
    to.resized = new_items(1, (size_t)to.fine_width * to.fine_height);
    to.half = new_items(1, (size_t)to.fine_width * to.fine_height);
    uint8_t *levels[2][3];
    for (int frame = 0; frame < 2; frame++) {
        uint8_t *pixels = read_items(3, (size_t)to.width * to.height);
        for (int level = 0; level < 3; level++)
            levels[frame][level] = new_items(1, (size_t)sizes[2 + 2 * level] * sizes[3 + 2 * level]);
        ssiam_pyramid(&to, pixels, 3 * (int64_t)to.width, levels[frame][0], levels[frame][1],
                      levels[frame][2]);
        for (int level = 0; level < 3; level++)
            write_items(levels[frame][level], 1,
                        (size_t)sizes[2 + 2 * level] * sizes[3 + 2 * level]);
    }
    for (int level = 0; level < 2; level++) {
        int32_t *layout = read_items(4, 8);
        Grid grid = {layout[0], layout[1], layout[2], layout[3], layout[4], layout[5], layout[6],
                     layout[7], {0}, {0}, NULL, NULL};
        int cells = grid.rows * grid.columns, samples = cells * grid.side * grid.side;
        memcpy(grid.pixel_from_unit, read_items(8, 9), sizeof grid.pixel_from_unit);
        memcpy(grid.unit_from_sample, read_items(8, 9), sizeof grid.unit_from_sample);
        grid.flow = read_items(4, 2 * (size_t)grid.freedom * cells);
        grid.bordered = new_items(1, (size_t)(grid.width + 3) * (grid.height + 3));
        float *share = read_items(4, cells), *change = new_items(4, cells);
        float *error = new_items(4, cells);
        double *numbers = read_items(8, 6), *transform = read_items(8, 9);
        Settings settings = {numbers[0], numbers[1], numbers[2], numbers[3], numbers[4],
                             (int32_t)numbers[5]};
        Template first = new_template(samples, cells), second = new_template(samples, cells);
        ssiam_template(&grid, levels[0][level], &first);
        ssiam_template(&grid, levels[1][level], &second);
        ssiam_change(&grid, &first, &second, change);
        ssiam_align(&grid, &first, levels[1][level], share, &settings, transform, error);
        write_items(first.products, 4, 3 * (size_t)cells);
        write_items(first.texture, 4, cells);
        write_items(change, 4, cells);
        write_items(transform, 8, 9);
        write_items(error, 4, cells);
    }
    int32_t shift_xy[2];
    float share[12];
    for (int block = 0; block < 12; block++)
        share[block] = 1;
    ssiam_block_shift(levels[0][2], levels[1][2], to.tiny_width, to.tiny_height, 10, share, 0.5f, 3,
                      4, shift_xy);
    write_items(shift_xy, 4, 2);
    return 0;
}
