/* The inner loops of direct alignment, compiled.
 *
 * Each function computes what the function of the same name in NumPy does, which is its reference:
 *
 *   ssiam_pyramid      PyramidBuilder.from_frame   pyramid.py
 *   ssiam_coarser      PyramidBuilder.from_fine    pyramid.py
 *   ssiam_template     CellTemplate                cells.py
 *   ssiam_change       CellTemplate.change_to      cells.py
 *   ssiam_align        align                       alignment.py
 *   ssiam_block_shift  _block_shift                coarse.py
 *
 * C99 without Python's headers: `kernel.py` calls it through ctypes, which releases the interpreter.
 * Nothing is allocated; images are rows of bytes, and all sizes are checked by `kernel.py`.
 * Pixels of the levels are exactly those of OpenCV; floats agree to rounding.
 */

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define ABI 1 /* changes with the structures below and with any signature; _ABI in kernel.py */

/* One copy of a function for each instruction set; the loader of the system chooses. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__GLIBC__)
#define FOR_EACH_CPU __attribute__((target_clones("default", "avx2")))
#else
#define FOR_EACH_CPU
#endif

#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum {
    MAX_WIDTH = 320,  /* pixels of a level, and samples along a row */
    MAX_CELLS = 512,
    MAX_FREEDOM = 8,
    MAX_TINY = 40,    /* pixels of the tiny level along each side */
    MAX_REACH = 10,   /* pixels of the search of blocks */
    LANES = 16,       /* partial sums, so that sums are vectorized in a defined order */
    SHIFTS = 24,      /* 2 * MAX_REACH + 1, rounded up for vectors */
    EDGE = 2,         /* reflected pixels on each side of a row */
    WITH_EDGES = MAX_WIDTH + 2 * EDGE
};

static const double DAMPING = 1e-6, EPSILON = 1e-9, MIN_TOLERANCE = 0.05;
static const double SINGULAR = 100 * 2.220446049250313e-16; /* pivot, as in OpenCV's solve */

typedef struct {
    int32_t width, height;             /* of the images */
    int32_t stride, first, side;       /* of samples */
    int32_t rows, columns, freedom;    /* of cells; of the model */
    double pixel_from_unit[9], unit_from_sample[9];
    const float *flow;                 /* (freedom, 2, rows * columns) */
    uint8_t *bordered;                 /* (height + 3, width + 3), workspace */
} Grid;

typedef struct {
    uint8_t *values;                   /* (rows * side, columns * side) samples */
    int16_t *gradients_x, *gradients_y;
    float *means;                      /* (2, cells) of the gradients */
    float *products;                   /* (3, cells) */
    float *texture;                    /* (cells,) */
} Template;

typedef struct {
    double noise, tolerance, evenness, min_step, tightening;
    int32_t max_iterations;
} Settings;

typedef struct {
    int32_t width, height;             /* of the frame */
    int32_t channels;                  /* 3: BGR, 1: gray */
    int32_t halfway;                   /* whether all weights are 1024 of 2048 */
    int32_t fine_width, fine_height, coarse_width, coarse_height, tiny_width, tiny_height;
    const int32_t *left, *right_weight; /* (fine_width,) columns of the frame; of 2048 */
    const int32_t *top, *bottom_weight; /* (fine_height,) rows of the frame; of 2048 */
    uint8_t *resized, *half;           /* workspace: of the fine level, and half of its sides */
} Reduction;

EXPORT int32_t ssiam_abi(void) { return ABI; }

/* The index within 0..count-1 that `index`, outside by less than count, is a reflection of. */
INLINE int reflected(int index, int count)
{
    if (count == 1)
        return 0;
    if (index < 0)
        index = -index;
    return index < count ? index : 2 * (count - 1) - index;
}

/* Reflect a row that begins at EDGE. */
INLINE void add_edges(int16_t *row, int width)
{
    if (width < 1)
        return;
    for (int k = 1; k <= EDGE; k++) {
        row[EDGE - k] = row[EDGE + reflected(-k, width)];
        row[EDGE + width - 1 + k] = row[EDGE + reflected(width - 1 + k, width)];
    }
}

/* ---- Pyramid ------------------------------------------------------------------------------ */

INLINE uint32_t gray_of(uint32_t blue, uint32_t green, uint32_t red)
{
    return (3735 * blue + 19235 * green + 9798 * red + 16384) >> 15;
}

/* Linear interpolation with OpenCV's rounding; horizontal weights and values below 2^19. */
INLINE uint32_t between(uint32_t left0, uint32_t right0, uint32_t left1, uint32_t right1,
                        uint32_t right_weight, uint32_t top_weight, uint32_t bottom_weight)
{
    uint32_t left_weight = 2048 - right_weight;
    uint32_t above = (left0 * left_weight + right0 * right_weight) >> 4;
    uint32_t below = (left1 * left_weight + right1 * right_weight) >> 4;
    return (((top_weight * above) >> 16) + ((bottom_weight * below) >> 16) + 2) >> 2;
}

/* Pixels of a row at some columns, and those after them, as 0x__RRGGBB. */
INLINE void pick_pixels(const uint8_t *row, const int32_t *columns, int count, int width,
                        uint32_t *restrict left, uint32_t *restrict right)
{
    int x, with_room = count; /* eight bytes after the last pixels are outside of the frame */
    while (with_room > 0 && columns[with_room - 1] >= width - 2)
        with_room--;
    for (x = 0; x < with_room; x++) {
        uint64_t pixels;
        memcpy(&pixels, row + 3 * columns[x], 8);
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
        pixels = __builtin_bswap64(pixels);
#endif
        left[x] = (uint32_t)pixels, right[x] = (uint32_t)(pixels >> 24);
    }
    for (; x < count; x++) {
        const uint8_t *at = row + 3 * columns[x];
        const uint8_t *next = columns[x] < width - 1 ? at + 3 : at;
        left[x] = at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16;
        right[x] = next[0] | (uint32_t)next[1] << 8 | (uint32_t)next[2] << 16;
    }
}

INLINE void resize_colors(const Reduction *to, const uint8_t *top, const uint8_t *bottom,
                          uint32_t bottom_weight, uint8_t *restrict out)
{
    uint32_t left0[MAX_WIDTH], right0[MAX_WIDTH], left1[MAX_WIDTH], right1[MAX_WIDTH];
    const int32_t *restrict weights = to->right_weight;
    int count = to->fine_width;
    uint32_t top_weight = 2048 - bottom_weight;
    pick_pixels(top, to->left, count, to->width, left0, right0);
    pick_pixels(bottom, to->left, count, to->width, left1, right1);
    if (to->halfway) { /* between() with equal weights is the mean: two colors at a time */
        const uint32_t two = 0x00ff00ff;
        for (int x = 0; x < count; x++) {
            uint32_t blue_red = (left0[x] & two) + (right0[x] & two) + (left1[x] & two) +
                                (right1[x] & two) + 0x00020002;
            uint32_t green = (left0[x] >> 8 & 255) + (right0[x] >> 8 & 255) +
                             (left1[x] >> 8 & 255) + (right1[x] >> 8 & 255) + 2;
            out[x] = (uint8_t)gray_of(blue_red >> 2 & 255, green >> 2, blue_red >> 18);
        }
        return;
    }
    for (int x = 0; x < count; x++) {
        uint32_t right = (uint32_t)weights[x], bgr[3];
        for (int c = 0; c < 3; c++)
            bgr[c] = between(left0[x] >> 8 * c & 255, right0[x] >> 8 * c & 255,
                             left1[x] >> 8 * c & 255, right1[x] >> 8 * c & 255, right, top_weight,
                             bottom_weight);
        out[x] = (uint8_t)gray_of(bgr[0], bgr[1], bgr[2]);
    }
}

INLINE void resize_gray(const Reduction *to, const uint8_t *top, const uint8_t *bottom,
                        uint32_t bottom_weight, uint8_t *out)
{
    uint32_t left0[MAX_WIDTH], right0[MAX_WIDTH], left1[MAX_WIDTH], right1[MAX_WIDTH];
    int last = to->width - 1;
    for (int x = 0; x < to->fine_width; x++) {
        int column = to->left[x], next = column < last ? column + 1 : column;
        left0[x] = top[column], right0[x] = top[next];
        left1[x] = bottom[column], right1[x] = bottom[next];
    }
    for (int x = 0; x < to->fine_width; x++)
        out[x] = (uint8_t)between(left0[x], right0[x], left1[x], right1[x],
                                  (uint32_t)to->right_weight[x], 2048 - bottom_weight,
                                  bottom_weight);
}

/* Binomial filter of 3 x 3 pixels. */
INLINE void blur(const uint8_t *image, int width, int height, uint8_t *out)
{
    int16_t sums[WITH_EDGES];
    for (int y = 0; y < height; y++) {
        const uint8_t *above = image + reflected(y - 1, height) * width;
        const uint8_t *row = image + y * width;
        const uint8_t *below = image + reflected(y + 1, height) * width;
        for (int x = 0; x < width; x++)
            sums[EDGE + x] = (int16_t)(above[x] + 2 * row[x] + below[x]);
        add_edges(sums, width);
        const int16_t *at = sums + EDGE;
        for (int x = 0; x < width; x++)
            out[y * width + x] = (uint8_t)((at[x - 1] + 2 * at[x] + at[x + 1] + 8) >> 4);
    }
}

/* Binomial filter of 5 x 5 pixels, at every second pixel along both sides. */
INLINE void halve(const uint8_t *image, int width, int height, uint8_t *out)
{
    int out_width = (width + 1) / 2;
    int16_t sums[WITH_EDGES];
    for (int y = 0; y < height; y += 2) {
        const uint8_t *row[5];
        for (int k = 0; k < 5; k++)
            row[k] = image + reflected(y + k - 2, height) * width;
        for (int x = 0; x < width; x++)
            sums[EDGE + x] = (int16_t)(row[0][x] + 4 * row[1][x] + 6 * row[2][x] +
                                       4 * row[3][x] + row[4][x]);
        add_edges(sums, width);
        const int16_t *at = sums + EDGE;
        for (int x = 0; x < out_width; x++)
            out[x] = (uint8_t)((at[2 * x - 2] + 4 * at[2 * x - 1] + 6 * at[2 * x] +
                                4 * at[2 * x + 1] + at[2 * x + 2] + 128) >> 8);
        out += out_width;
    }
}

/* Ask for a row of a frame before it is read: frames are larger than the caches. */
INLINE void prefetch_row(const uint8_t *row, int bytes)
{
#if defined(__GNUC__)
    for (int at = 0; at < bytes; at += 64)
        __builtin_prefetch(row + at);
#else
    (void)row, (void)bytes;
#endif
}

EXPORT FOR_EACH_CPU void ssiam_coarser(const Reduction *to, const uint8_t *fine, uint8_t *coarse,
                                       uint8_t *tiny)
{
    halve(fine, to->fine_width, to->fine_height, to->half);
    halve(to->half, (to->fine_width + 1) / 2, (to->fine_height + 1) / 2, coarse);
    halve(coarse, to->coarse_width, to->coarse_height, tiny);
}

EXPORT FOR_EACH_CPU void ssiam_pyramid(const Reduction *to, const uint8_t *frame, int64_t row_bytes,
                                       uint8_t *fine, uint8_t *coarse, uint8_t *tiny)
{
    for (int y = 0; y < to->fine_height; y++) {
        const uint8_t *top = frame + to->top[y] * row_bytes;
        const uint8_t *bottom = to->top[y] < to->height - 1 ? top + row_bytes : top;
        uint8_t *row = to->resized + y * to->fine_width;
        int ahead = to->top[y + 2 < to->fine_height ? y + 2 : y];
        prefetch_row(frame + ahead * row_bytes, to->channels * to->width);
        if (ahead < to->height - 1)
            prefetch_row(frame + (ahead + 1) * row_bytes, to->channels * to->width);
        if (to->channels == 1)
            resize_gray(to, top, bottom, (uint32_t)to->bottom_weight[y], row);
        else
            resize_colors(to, top, bottom, (uint32_t)to->bottom_weight[y], row);
    }
    blur(to->resized, to->fine_width, to->fine_height, fine);
    halve(fine, to->fine_width, to->fine_height, to->half);
    halve(to->half, (to->fine_width + 1) / 2, (to->fine_height + 1) / 2, coarse);
    halve(coarse, to->coarse_width, to->coarse_height, tiny);
}

/* ---- Templates ---------------------------------------------------------------------------- */

/* Samples of a row, from column sums (1, 2, 1) and differences of it and its neighbors. */
INLINE void sample_row(const uint8_t *row, const int16_t *sums, const int16_t *differences,
                       int count, int stride, int16_t *gx, int16_t *gy, uint8_t *values)
{
    for (int x = 0; x < count; x++) {
        int at = x * stride;
        gx[x] = (int16_t)(sums[at + 1] - sums[at - 1]);
        gy[x] = (int16_t)(differences[at - 1] + 2 * differences[at] + differences[at + 1]);
        values[x] = row[at];
    }
}

/* Sum of the samples of each cell along a row. */
INLINE int sum_of(const int32_t *columns, int cell, int side)
{
    int total = 0;
    for (int x = 0; x < side; x++)
        total += columns[cell * side + x];
    return total;
}

EXPORT FOR_EACH_CPU void ssiam_template(const Grid *grid, const uint8_t *image, Template *out)
{
    int width = grid->width, height = grid->height, side = grid->side, first = grid->first;
    int count = grid->columns * side, cells = grid->rows * grid->columns;
    double share = 1.0 / (side * side);
    int16_t sums[WITH_EDGES], differences[WITH_EDGES];
    const int16_t *sums_from = sums + EDGE + first, *differences_from = differences + EDGE + first;
    for (int cell_row = 0; cell_row < grid->rows; cell_row++) {
        int32_t of_x[MAX_WIDTH] = {0}, of_y[MAX_WIDTH] = {0}, of_v[MAX_WIDTH] = {0};
        int32_t xx[MAX_WIDTH] = {0}, xy[MAX_WIDTH] = {0}, yy[MAX_WIDTH] = {0};
        int32_t vv[MAX_WIDTH] = {0};
        for (int line = 0; line < side; line++) {
            int sample_y = cell_row * side + line, y = first + sample_y * grid->stride;
            const uint8_t *above = image + reflected(y - 1, height) * width;
            const uint8_t *row = image + y * width;
            const uint8_t *below = image + reflected(y + 1, height) * width;
            for (int x = 0; x < width; x++) {
                sums[EDGE + x] = (int16_t)(above[x] + 2 * row[x] + below[x]);
                differences[EDGE + x] = (int16_t)(below[x] - above[x]);
            }
            add_edges(sums, width);
            add_edges(differences, width);
            int16_t *gx = out->gradients_x + sample_y * count;
            int16_t *gy = out->gradients_y + sample_y * count;
            uint8_t *values = out->values + sample_y * count;
            if (grid->stride == 1)
                sample_row(row + first, sums_from, differences_from, count, 1, gx, gy, values);
            else if (grid->stride == 2)
                sample_row(row + first, sums_from, differences_from, count, 2, gx, gy, values);
            else
                sample_row(row + first, sums_from, differences_from, count, grid->stride, gx, gy,
                           values);
            for (int x = 0; x < count; x++) {
                int32_t dx = gx[x], dy = gy[x], value = values[x];
                of_x[x] += dx, of_y[x] += dy, of_v[x] += value;
                xx[x] += dx * dx, xy[x] += dx * dy, yy[x] += dy * dy, vv[x] += value * value;
            }
        }
        for (int column = 0; column < grid->columns; column++) {
            int cell = cell_row * grid->columns + column;
            double x = sum_of(of_x, column, side), y = sum_of(of_y, column, side);
            double value = sum_of(of_v, column, side);
            out->means[cell] = (float)(x * share);
            out->means[cells + cell] = (float)(y * share);
            out->products[cell] = (float)(sum_of(xx, column, side) - x * x * share);
            out->products[cells + cell] = (float)(sum_of(xy, column, side) - x * y * share);
            out->products[2 * cells + cell] = (float)(sum_of(yy, column, side) - y * y * share);
            out->texture[cell] =
                (float)((sum_of(vv, column, side) - value * value * share) * share);
        }
    }
}

EXPORT FOR_EACH_CPU void ssiam_change(const Grid *grid, const Template *before,
                                      const Template *after, float *change)
{
    int side = grid->side, count = grid->columns * side;
    double share = 1.0 / (side * side);
    for (int cell_row = 0; cell_row < grid->rows; cell_row++) {
        int32_t sums[MAX_WIDTH] = {0}, squares[MAX_WIDTH] = {0};
        for (int line = 0; line < side; line++) {
            const uint8_t *old_values = before->values + (cell_row * side + line) * count;
            const uint8_t *new_values = after->values + (cell_row * side + line) * count;
            for (int x = 0; x < count; x++) {
                int32_t difference = new_values[x] - old_values[x];
                sums[x] += difference, squares[x] += difference * difference;
            }
        }
        for (int column = 0; column < grid->columns; column++) {
            double sum = sum_of(sums, column, side);
            change[cell_row * grid->columns + column] =
                (float)((sum_of(squares, column, side) - sum * sum * share) * share);
        }
    }
}

/* ---- Alignment ---------------------------------------------------------------------------- */

INLINE void multiply(const double *left, const double *right, double *out)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            out[3 * i + j] = left[3 * i] * right[j] + left[3 * i + 1] * right[3 + j] +
                             left[3 * i + 2] * right[6 + j];
}

INLINE float dot(const float *left, const float *right, int count)
{
    float lanes[LANES] = {0}, total = 0;
    int whole = count / LANES * LANES;
    for (int at = 0; at < whole; at += LANES)
        for (int lane = 0; lane < LANES; lane++)
            lanes[lane] += left[at + lane] * right[at + lane];
    for (int at = whole; at < count; at++)
        total += left[at] * right[at];
    for (int lane = 0; lane < LANES; lane++)
        total += lanes[lane];
    return total;
}

/* Solve by elimination with pivots; the steps are 0 if the matrix is singular. */
INLINE void solve(double matrix[MAX_FREEDOM][MAX_FREEDOM + 1], int size, double *steps)
{
    memset(steps, 0, MAX_FREEDOM * sizeof *steps);
    for (int i = 0; i < size; i++) {
        int pivot = i;
        for (int row = i + 1; row < size; row++)
            if (fabs(matrix[row][i]) > fabs(matrix[pivot][i]))
                pivot = row;
        if (!(fabs(matrix[pivot][i]) >= SINGULAR))
            return;
        for (int k = i; k <= size; k++) {
            double held = matrix[i][k];
            matrix[i][k] = matrix[pivot][k], matrix[pivot][k] = held;
        }
        for (int row = i + 1; row < size; row++) {
            double factor = matrix[row][i] / matrix[i][i];
            for (int k = i; k <= size; k++)
                matrix[row][k] -= factor * matrix[i][k];
        }
    }
    for (int i = size - 1; i >= 0; i--) {
        double value = matrix[i][size];
        for (int k = i + 1; k < size; k++)
            value -= matrix[i][k] * steps[k];
        steps[i] = value / matrix[i][i];
    }
}

/* Apply a step against each generator before the transform, and restore the model's form. */
INLINE void refine(double *transform, const double *step, int freedom)
{
    double small[9] = {1 - step[3] - step[4], step[2] - step[5], -step[0],
                       -step[2] - step[5], 1 - step[3] + step[4], -step[1],
                       step[6], step[7], 1};
    double product[9];
    multiply(transform, small, product);
    double scale = 1;
    if (freedom == 3)
        scale = sqrt(fabs(product[0] * product[4] - product[1] * product[3]));
    else if (freedom == 8)
        scale = product[8];
    for (int i = 0; i < 9; i++)
        transform[i] = product[i];
    if (freedom == 3)
        transform[0] /= scale, transform[1] /= scale, transform[3] /= scale, transform[4] /= scale;
    else if (freedom == 8)
        for (int i = 0; i < 9; i++)
            transform[i] /= scale;
}

/* Where the samples of a row are in the bordered image: the pixel, and the way to the next one. */
INLINE void map_row(const Grid *grid, const double *pixel_from_sample, int y, int32_t *at,
                    float *right, float *down)
{
    const double *m = pixel_from_sample;
    float start_x = (float)(m[1] * y + m[2]), start_y = (float)(m[4] * y + m[5]);
    float start_w = (float)(m[7] * y + m[8]);
    float step_x = (float)m[0], step_y = (float)m[3], step_w = (float)m[6];
    float end_x = (float)(grid->width + 1), end_y = (float)(grid->height + 1);
    int row_bytes = grid->width + 3, count = grid->columns * grid->side;
    float along[MAX_WIDTH], across[MAX_WIDTH];
    if (grid->freedom == 8)
        for (int x = 0; x < count; x++) {
            float w = start_w + step_w * (float)x;
            along[x] = (start_x + step_x * (float)x) / w + 1;
            across[x] = (start_y + step_y * (float)x) / w + 1;
        }
    else
        for (int x = 0; x < count; x++) {
            along[x] = start_x + step_x * (float)x + 1;
            across[x] = start_y + step_y * (float)x + 1;
        }
    for (int x = 0; x < count; x++) { /* what is not a number becomes 0 */
        float to_right = along[x] > 0 ? along[x] : 0, to_bottom = across[x] > 0 ? across[x] : 0;
        to_right = to_right < end_x ? to_right : end_x;
        to_bottom = to_bottom < end_y ? to_bottom : end_y;
        int32_t column = (int32_t)to_right, row = (int32_t)to_bottom;
        right[x] = to_right - (float)column, down[x] = to_bottom - (float)row;
        at[x] = row * row_bytes + column;
    }
}

/* Error of each cell, and its sums of the gradients times the residual. */
INLINE void residuals(const Grid *grid, const Template *template, const double *pixel_from_sample,
                      float *error, float *slope_x, float *slope_y)
{
    int side = grid->side, count = grid->columns * side, cells = grid->rows * grid->columns;
    int row_bytes = grid->width + 3;
    float share = 1.0f / (float)(side * side);
    for (int cell_row = 0; cell_row < grid->rows; cell_row++) {
        float sums[MAX_WIDTH] = {0}, squares[MAX_WIDTH] = {0};
        float with_x[MAX_WIDTH] = {0}, with_y[MAX_WIDTH] = {0};
        for (int line = 0; line < side; line++) {
            int32_t at[MAX_WIDTH];
            float right[MAX_WIDTH], down[MAX_WIDTH];
            uint16_t upper[MAX_WIDTH], lower[MAX_WIDTH];
            int y = cell_row * side + line;
            map_row(grid, pixel_from_sample, y, at, right, down);
            for (int x = 0; x < count; x++) {
                memcpy(upper + x, grid->bordered + at[x], 2);
                memcpy(lower + x, grid->bordered + at[x] + row_bytes, 2);
            }
            const uint8_t *values = template->values + y * count;
            const int16_t *gx = template->gradients_x + y * count;
            const int16_t *gy = template->gradients_y + y * count;
            for (int x = 0; x < count; x++) {
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
                float a = upper[x] >> 8, b = upper[x] & 255, c = lower[x] >> 8, d = lower[x] & 255;
#else
                float a = upper[x] & 255, b = upper[x] >> 8, c = lower[x] & 255, d = lower[x] >> 8;
#endif
                float above = a + right[x] * (b - a), below = c + right[x] * (d - c);
                float residual = above + down[x] * (below - above) - values[x];
                sums[x] += residual, squares[x] += residual * residual;
                with_x[x] += gx[x] * residual, with_y[x] += gy[x] * residual;
            }
        }
        for (int column = 0; column < grid->columns; column++) {
            int cell = cell_row * grid->columns + column;
            float sum = 0, square = 0, x_sum = 0, y_sum = 0;
            for (int x = column * side; x < (column + 1) * side; x++)
                sum += sums[x], square += squares[x], x_sum += with_x[x], y_sum += with_y[x];
            float variance = square * share - sum * share * (sum * share);
            error[cell] = variance > 0 ? variance : 0;
            slope_x[cell] = x_sum - template->means[cell] * sum;
            slope_y[cell] = y_sum - template->means[cells + cell] * sum;
        }
    }
}

/* Steps along the generators that best explain the residuals of the weighted cells. */
INLINE void best_steps(const Grid *grid, const Template *template, const float *weight,
                       const float *slope_x, const float *slope_y, double *steps)
{
    int cells = grid->rows * grid->columns, freedom = grid->freedom;
    const float *products = template->products;
    float xx[MAX_CELLS], xy[MAX_CELLS], yy[MAX_CELLS], x[MAX_CELLS], y[MAX_CELLS];
    for (int cell = 0; cell < cells; cell++) {
        xx[cell] = products[cell] * weight[cell];
        xy[cell] = products[cells + cell] * weight[cell];
        yy[cell] = products[2 * cells + cell] * weight[cell];
        x[cell] = slope_x[cell] * weight[cell], y[cell] = slope_y[cell] * weight[cell];
    }
    double matrix[MAX_FREEDOM][MAX_FREEDOM + 1];
    for (int i = 0; i < freedom; i++) {
        const float *fx = grid->flow + 2 * i * cells, *fy = fx + cells;
        float by_x[MAX_CELLS], by_y[MAX_CELLS];
        for (int cell = 0; cell < cells; cell++) {
            by_x[cell] = fx[cell] * xx[cell] + fy[cell] * xy[cell];
            by_y[cell] = fx[cell] * xy[cell] + fy[cell] * yy[cell];
        }
        for (int j = i; j < freedom; j++) {
            const float *other = grid->flow + 2 * j * cells;
            matrix[i][j] = matrix[j][i] =
                dot(other, by_x, cells) + (double)dot(other + cells, by_y, cells);
        }
        matrix[i][freedom] = dot(fx, x, cells) + (double)dot(fy, y, cells);
    }
    double damping = DAMPING * matrix[0][0] + EPSILON;
    for (int i = 0; i < freedom; i++)
        matrix[i][i] += damping;
    solve(matrix, freedom, steps);
}

INLINE void add_border(const Grid *grid, const uint8_t *image)
{
    int width = grid->width, height = grid->height, row_bytes = width + 3;
    memset(grid->bordered, 0, (size_t)row_bytes);
    for (int y = 0; y < height; y++) {
        uint8_t *row = grid->bordered + (y + 1) * row_bytes;
        row[0] = row[width + 1] = row[width + 2] = 0;
        memcpy(row + 1, image + y * width, (size_t)width);
    }
    memset(grid->bordered + (height + 1) * row_bytes, 0, 2 * (size_t)row_bytes);
}

EXPORT FOR_EACH_CPU void ssiam_align(const Grid *grid, const Template *template,
                                     const uint8_t *image, const float *background_share,
                                     const Settings *settings, double *cur_from_prev, float *error)
{
    int cells = grid->rows * grid->columns;
    float weight[MAX_CELLS], tolerated[MAX_CELLS], agreeing[MAX_CELLS];
    float slope_x[MAX_CELLS], slope_y[MAX_CELLS];
    double tolerance = settings->tolerance, noise = settings->noise * settings->noise;
    add_border(grid, image);
    for (int cell = 0; cell < cells; cell++)
        weight[cell] = background_share[cell] *
                       powf(template->texture[cell] + (float)noise, (float)-settings->evenness);
    for (int iteration = 0; iteration < settings->max_iterations; iteration++) {
        double pixel_from_prev[9], pixel_from_sample[9], steps[MAX_FREEDOM], size = 0;
        multiply(grid->pixel_from_unit, cur_from_prev, pixel_from_prev);
        multiply(pixel_from_prev, grid->unit_from_sample, pixel_from_sample);
        residuals(grid, template, pixel_from_sample, error, slope_x, slope_y);
        for (int cell = 0; cell < cells; cell++) {
            tolerated[cell] = (float)noise + (float)tolerance * template->texture[cell];
            float agreement = tolerated[cell] / (tolerated[cell] + error[cell]);
            agreeing[cell] = weight[cell] * (agreement * agreement);
        }
        best_steps(grid, template, agreeing, slope_x, slope_y, steps);
        refine(cur_from_prev, steps, grid->freedom);
        for (int i = 0; i < grid->freedom; i++)
            size += fabs(steps[i]);
        if (size < settings->min_step)
            break;
        tolerance *= settings->tightening;
        if (settings->tightening < 1 && tolerance < MIN_TOLERANCE)
            tolerance = MIN_TOLERANCE;
    }
}

/* ---- Block matching ----------------------------------------------------------------------- */

/* Add the squared normalized correlations of a block with the windows around it. */
INLINE void add_correlations(float (*padded)[MAX_TINY + 2 * MAX_REACH + SHIFTS],
                             int32_t (*sums)[MAX_TINY + 2 * MAX_REACH + 1],
                             int32_t (*squares)[MAX_TINY + 2 * MAX_REACH + 1], const uint8_t *prev,
                             int width, int top, int left, int block_width, int block_height,
                             int reach, float *total)
{
    int span = 2 * reach + 1;
    float block[MAX_TINY * MAX_TINY];
    double count = (double)block_width * block_height, sum = 0, square = 0;
    for (int y = 0; y < block_height; y++)
        for (int x = 0; x < block_width; x++) {
            int value = prev[(top + y) * width + left + x];
            sum += value, square += value * value;
            block[y * block_width + x] = (float)value;
        }
    double norm = sqrt(square - sum * sum / count);
    float always = square * count - sum * sum == 0; /* OpenCV: a flat block matches everything */
    for (int dy = 0; dy < span; dy++) {
        float products[SHIFTS] = {0}; /* exact: whole numbers below 2^24 */
        for (int y = 0; y < block_height; y++) {
            const float *values = block + y * block_width, *row = padded[top + y + dy] + left;
            for (int x = 0; x < block_width; x++)
                for (int dx = 0; dx < SHIFTS; dx++)
                    products[dx] += values[x] * row[x + dx];
        }
        const int32_t *sum0 = sums[top + dy] + left, *square0 = squares[top + dy] + left;
        const int32_t *sum1 = sums[top + dy + block_height] + left;
        const int32_t *square1 = squares[top + dy + block_height] + left;
        for (int dx = 0; dx < span; dx++) {
            int to = dx + block_width;
            float window = (float)(sum1[to] - sum0[to] - sum1[dx] + sum0[dx]);
            double window_square = square1[to] - square0[to] - square1[dx] + square0[dx];
            double variance = window_square - (double)window * window / count;
            double limit = 10 * 1.1920929e-07 * window_square;
            limit = limit < 0.5 ? limit : 0.5;
            float norms = variance <= limit ? 0 : (float)(sqrt(variance) * norm);
            float product = (float)(products[dx] - (double)window * sum / count);
            float correlation = product > 0 ? product / norms : 0;
            correlation = correlation < 1 ? correlation : 1;
            correlation = product < 1.125f * norms ? correlation : 0;
            total[dy * span + dx] += correlation * correlation + always;
        }
    }
}

/* Smoothed by a binomial filter of 3 x 3, in place; `line` is workspace. */
INLINE void smooth(float *map, int span, float *line)
{
    for (int pass = 0; pass < 2; pass++) {
        int step = pass ? span : 1, across = pass ? 1 : span;
        for (int i = 0; i < span; i++) {
            float *from = map + i * across;
            for (int k = -1; k <= span; k++)
                line[k + 1] = from[reflected(k, span) * step];
            for (int k = 0; k < span; k++)
                from[k * step] = 0.25f * line[k] + 0.5f * line[k + 1] + 0.25f * line[k + 2];
        }
    }
}

EXPORT FOR_EACH_CPU void ssiam_block_shift(const uint8_t *prev, const uint8_t *cur, int32_t width,
                                           int32_t height, int32_t reach, const float *share,
                                           float min_share, int32_t rows, int32_t columns,
                                           int32_t *shift_xy)
{
    enum { SIDE = MAX_TINY + 2 * MAX_REACH };
    float padded[SIDE][SIDE + SHIFTS];
    int32_t sums[SIDE + 1][SIDE + 1], squares[SIDE + 1][SIDE + 1];
    float total[SHIFTS * SHIFTS] = {0}, best = -1;
    int span = 2 * reach + 1, block_width = width / columns, block_height = height / rows;
    memset(padded, 0, sizeof padded);
    memset(sums, 0, sizeof sums);
    memset(squares, 0, sizeof squares);
    for (int y = 0; y < height + 2 * reach; y++)
        for (int x = 0; x < width + 2 * reach; x++) {
            int value =
                cur[reflected(y - reach, height) * width + reflected(x - reach, width)];
            padded[y][x] = (float)value;
            sums[y + 1][x + 1] = sums[y][x + 1] + sums[y + 1][x] - sums[y][x] + value;
            squares[y + 1][x + 1] =
                squares[y][x + 1] + squares[y + 1][x] - squares[y][x] + value * value;
        }
    for (int row = 0; row < rows; row++)
        for (int column = 0; column < columns; column++)
            if (share[row * columns + column] >= min_share)
                add_correlations(padded, sums, squares, prev, width, row * block_height,
                                 column * block_width, block_width, block_height, reach, total);
    float line[SHIFTS + 2];
    smooth(total, span, line);
    for (int at = 0; at < span * span; at++)
        if (total[at] > best)
            best = total[at], shift_xy[0] = at % span - reach, shift_xy[1] = at / span - reach;
}
