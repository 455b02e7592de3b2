#define DUET_EIGEN Eigen_v3
#define DUET_KERNEL kDenseKernelsV3
#define DUET_LEVEL InstructionSet::kV3
#include "duet/nn/dense_kernels_body.h"
