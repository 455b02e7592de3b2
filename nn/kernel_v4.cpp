#define DUET_EIGEN Eigen_v4
#define DUET_KERNEL kDenseKernelsV4
#define DUET_LEVEL "x86-64-v4"
#include "duet/nn/dense_kernels_body.h"
