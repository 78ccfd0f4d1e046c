+define+RV32I
-f $SOFTCORE/sim/picorv32.f
