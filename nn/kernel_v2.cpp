#define DUET_EIGEN Eigen_v2
#define DUET_KERNEL kDenseKernelsV2
#define DUET_LEVEL "x86-64-v2"
#include "duet/nn/dense_kernels_body.h"
